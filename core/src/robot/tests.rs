//! Tests of the robot as a whole.

use super::*;
