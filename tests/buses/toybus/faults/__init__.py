"""What can be injected into drives on the toy bus."""
