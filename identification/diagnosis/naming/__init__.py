"""Which effect of the library is missing: score tests, multi-start fits, forward selection."""
