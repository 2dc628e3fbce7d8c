"""Electronic data sheets, the files by which makers describe devices on CIP (CIP volume 1, chapter 7)."""
