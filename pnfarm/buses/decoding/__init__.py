"""What the decoders of captures have in common on all buses."""
