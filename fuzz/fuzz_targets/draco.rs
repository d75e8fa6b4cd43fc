#![no_main]
firsthit_fuzz::files!(draco);
