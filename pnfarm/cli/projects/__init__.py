"""Engineering projects and captures, as commands read them."""
