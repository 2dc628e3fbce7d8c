"""What a model's electronic data sheet says of it."""
