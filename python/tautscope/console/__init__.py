"""The operator's console: a page in the browser that shows the loop and commands its reference."""
