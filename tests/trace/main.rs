//! The tracer against arithmetic: scenes whose radiance is known, and facts that hold for all.

mod eye;
mod flat;
mod hidden;
mod instances;
mod light;
mod rig;
mod robust;
mod shapes;
mod soft;
mod solid;
