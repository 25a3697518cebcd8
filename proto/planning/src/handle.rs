//! The hand at the handle of a door that turns. The report on a home and the scripted operator
//! use the same.

/// Shares of the door's angle by which the hand may lag behind it, turning about the handle, the
/// least first: 38° at a door that is open by 48°. A rigid grip reaches fewer doors.
pub const LAGS: [f64; 3] = [0.0, 0.4, 0.8];
