"""What the axis record holds, subject by subject: each file beside the firmware module of its name, which writes it."""
