//! One valid generation is always there, and one that is damaged is noticed.
