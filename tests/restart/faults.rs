//! The disk is full, fails, is read-only or gone; signals come at any moment.
