"""Fields of the axis record by subject: each file is named like the firmware module that writes its fields."""
