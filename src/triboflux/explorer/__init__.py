"""The web page of `triboflux explore`: inputs, live runs, a map and downloads, on this machine."""
