#![no_main]
firsthit_fuzz::files!(obj);
