"""The package beside the tools that people would use instead, on the same problems."""
