"""The leg in the browser: a live simulation, a trace, or the real leg while it runs."""
