"""The types of what the API answers about drives and the farm, and its problem documents."""
