"""Parameters: rules, and the one place where Python reads them."""
