//! The parameters of the reconstruction.

use crate::scan::Support;

crate::choice! {
    /// How the mesh is inflated.
    pub enum InflateMethod {
        /// The inside space by the winding number of the points: closes holes, finds the true
        /// genus.
        Field = "field",
        /// The thesis's: a tetrahedron grows vertex by vertex.
        Thesis = "thesis",
    }
}

crate::choice! {
    /// How the mesh is brought to the points.
    pub enum DetailMethod {
        /// Implicit moving least squares, isotropic remeshing.
        Implicit = "implicit",
        /// The thesis's: mean of the points in the finding range, splits, smoothing, regularising.
        Thesis = "thesis",
    }
}

crate::params! {
    /// Parameters of the reconstruction.
    pub struct ReconstructParams("reconstruct") {
        /// How the coarse mesh is made: field takes the inside space by the winding number of the
        /// points, which closes holes and finds the true genus; thesis grows a tetrahedron vertex
        /// by vertex (Wiedemann 2014).
        inflate: InflateMethod = InflateMethod::Field;
        /// How the mesh is brought to the points: implicit by implicit moving least squares and
        /// isotropic remeshing, thesis by the mean of the points near each vertex, with smoothing
        /// and regularising (Wiedemann 2014).
        detail: DetailMethod = DetailMethod::Implicit;
        /// Edge length of the finished mesh (`l_m` of the thesis); 0 derives it from the distance
        /// between the points.
        edge_length: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Edge length of the mesh at the start of detailing (`l_0` of the thesis), in voxel edges.
        start_edge: f64 = 1.3, in [0.5, 10.0];
        /// Voxel edge of the inflation (`l` of the thesis), for the method field the distance
        /// between the corners of its lattice; 0 derives it from the distance and the noise of the
        /// points.
        voxel_edge: f64 = 0.0, in [0.0, 1.0], unit "m";
        /// Number of steps of detailing from the first to the finished edge length (`i_max` of the
        /// thesis).
        iterations: usize = 4, in [0, 1000];
        /// What the object stands on: none, or table for the plane z = 0, where its underside then
        /// closes.
        support: Support = Support::None;
        /// Largest number of separate bodies in the mesh; the largest ones are kept.
        components: usize = 1, in [1, 1000];
        /// Strength of the smoothing of the thesis (`k_s`), used by the detail method thesis only.
        smoothing: f64 = 0.3, in [0.0, 0.5];
        /// Smallest angle between vertex normals at which the detail method thesis smooths.
        smooth_angle_min: f64 = 0.0, in [0.0, 3.15], unit "rad";
        /// Largest angle between vertex normals at which the detail method thesis smooths; sharper
        /// edges stay.
        smooth_angle_max: f64 = 1.0, in [0.0, 3.15], unit "rad";
        /// Strength of the regularising of the thesis (`k_reg`), used by the detail method thesis
        /// only.
        regularising: f64 = 0.1, in [0.0, 0.5];
    }
}
