//! Next best view (Wiedemann 2014, §2.2).
