//! Hands as solids: what they leave free of objects and of each other.
