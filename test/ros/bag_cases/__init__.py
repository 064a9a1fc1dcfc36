"""Bags as other people have them: cases made of a simulated survey, and what is to come of each."""
