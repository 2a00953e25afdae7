//! Immobility: forces that hold the object, and closure.
