"""Engineering projects and makers' files in folders, as far as any bus reads them."""
