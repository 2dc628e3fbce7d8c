"""PROFIdrive front of the firmware: control words and set points in, status words and actual values out."""
