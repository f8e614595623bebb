"""Base: errors, texts, parameters and registries, which everything else is written with."""
