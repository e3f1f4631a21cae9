//! What the object stands on.

crate::choice! {
    /// What the object stands on.
    #[derive(Default)]
    pub enum Support {
        /// Nothing that is known.
        #[default]
        None = "none",
        /// The plane z = 0 of the object frame, the object above it.
        Table = "table",
    }
}
