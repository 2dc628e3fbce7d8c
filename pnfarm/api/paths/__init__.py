"""The paths of the API, a file for each subject, over what a farm and a hub both answer."""
