"""A survey's past, smoothed when it is over; and the best that any method could make of it."""
