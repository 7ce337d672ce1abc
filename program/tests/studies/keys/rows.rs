//! One row and more for every key of the format: a leaf in which it matters, and another value.

use leafdyn::scenario::Key;

/// On which answers a key acts by physics.
#[derive(Clone, Copy, PartialEq)]
pub enum Acts {
    /// On leaves at rest, on their modes, and on motions.
    Always,
    /// On modes and motions: inertia has no part in equilibria.
    Inertia,
    /// On motions alone: damping, times, and loads in time have no part in equilibria and in
    /// undamped vibrations.
    Motions,
    /// On what photographs say about a leaf.
    Photographs,
    /// On the answer of no verb, for this reason.
    Nowhere(&'static str),
}

/// A key and another value of it in a leaf.
#[derive(Clone)]
pub struct Row {
    pub key: Key,
    pub leaf: &'static str,
    /// The entry as in `--set`.
    pub set: &'static str,
    pub acts: Acts,
    /// Whether derivatives tell the change.
    pub is_smooth: bool,
}

const NAMES: &str = "a name: no number depends on it";
const ACCURACY: &str = "how accurate answers are, not which";

/// The rows of a key. A new key does not compile without one.
pub fn rows(key: Key) -> Vec<Row> {
    let row = |leaf, set, acts, is_smooth| Row {
        key,
        leaf,
        set,
        acts,
        is_smooth,
    };
    let smooth = |leaf, set| vec![row(leaf, set, Acts::Always, true)];
    let always = |leaf, set| vec![row(leaf, set, Acts::Always, false)];
    let motions = |leaf, set| vec![row(leaf, set, Acts::Motions, false)];
    let photographs = |leaf, set| vec![row(leaf, set, Acts::Photographs, false)];
    let nowhere = |why| vec![row("", "", Acts::Nowhere(why), false)];
    match key {
        Key::Name | Key::UnitLength | Key::UnitForce | Key::UnitTime => nowhere(NAMES),
        Key::Tolerance => nowhere(ACCURACY),
        Key::Rods => always("veins", "leaf.rods=3"),
        Key::Length => smooth("veins", "leaf.length=1.02"),
        Key::Fan => always("veins", "leaf.fan=[-0.3,0.5]"),
        Key::Joined => always("veins", "leaf.joined=false"),
        Key::Base => always("veins", "leaf.base=[[0.0,-0.1,0.0],[0.05,0.1,0.02]]"),
        Key::Elevation => smooth("blade", "leaf.elevation=0.42"),
        Key::BaseHeld => [
            always("pulled", "leaf.base_held=pinned"),
            always("rooted", "leaf.base_held=['elastic','clamped']"),
            always("mixed", "leaf.base_held=['elastic','clamped','elastic']"),
        ]
        .concat(),
        Key::BaseSpin => always("mixed", "leaf.base_spin=held"),
        Key::BaseTurnStiffness => [
            smooth("rooted", "leaf.base_turn_stiffness=1.9"),
            smooth("mixed", "leaf.base_turn_stiffness=1.9"),
        ]
        .concat(),
        Key::Torsion => smooth("veins", "stiffness.torsion=0.75"),
        Key::Bending2 => smooth("veins", "stiffness.bending_2=0.85"),
        Key::Bending3 => smooth("veins", "stiffness.bending_3=1.25"),
        Key::Axial => smooth("veins", "stiffness.axial=110"),
        Key::Shear2 => smooth("veins", "stiffness.shear_2=90"),
        Key::Shear3 => smooth("veins", "stiffness.shear_3=100"),
        Key::SectionShape => always("oval", "section.shape=rectangle"),
        Key::Diameter => smooth("tube", "section.diameter=0.101"),
        Key::Width => [
            smooth("oval", "section.width=0.205"),
            smooth("prism", "section.width=0.122"),
            smooth("cane", "section.width=0.091"),
            smooth("gutter", "section.width=0.142"),
        ]
        .concat(),
        Key::Thickness => [
            smooth("oval", "section.thickness=0.102"),
            smooth("prism", "section.thickness=0.103"),
            smooth("gutter", "section.thickness=0.104"),
        ]
        .concat(),
        Key::InnerDiameter => smooth("tube", "section.inner_diameter=0.055"),
        Key::Wall => [
            smooth("walled", "section.wall=0.021"),
            smooth("gutter", "section.wall=0.0205"),
        ]
        .concat(),
        Key::Young => smooth("oval", "section.young=1.05e5"),
        Key::Poisson => smooth("oval", "section.poisson=0.35"),
        Key::SectionShearModulus => smooth("fibrous", "section.shear_modulus=5.5e3"),
        Key::MassDensity => smooth("oval", "section.mass_density=2.1"),
        Key::BladeLength => smooth("blade", "blade.length=25.5"),
        Key::BladeWidth => always(
            "blade",
            "blade.width={at=[0.0,0.4,1.0],value=[1.2,2.0,0.0]}",
        ),
        Key::BladeThickness => smooth("blade", "blade.thickness=0.0305"),
        Key::BladeYoung => smooth("blade", "blade.young=5.1e4"),
        // Less is within the bar of the coarse grid.
        Key::YoungAcross => always("blade", "blade.young_across=4e5"),
        Key::ShearModulus => always("blade", "blade.shear_modulus=1.5e4"),
        Key::BladePoisson => smooth("blade", "blade.poisson=0.32"),
        Key::BladeMassDensity => smooth("blade", "blade.mass_density=8.2e-6"),
        Key::Edges => always("blade", "blade.edges=false"),
        Key::LeastWidth => always("blade", "blade.least_width=0.2"),
        Key::RestTwist => smooth("veins", "rest.twist=0.35"),
        Key::RestBend2 => smooth("veins", "rest.bend_2=0.45"),
        Key::RestBend3 => smooth("veins", "rest.bend_3=0.25"),
        Key::RestStretch => smooth("veins", "rest.stretch=1.07"),
        Key::CouplingX => smooth("veins", "coupling.x=1.2"),
        Key::CouplingY => smooth("veins", "coupling.y=2.2"),
        Key::CouplingZ => smooth("veins", "coupling.z=1.7"),
        Key::TissueAlong => smooth("veins", "tissue.along=2.3"),
        Key::TissueAcross => smooth("veins", "tissue.across=3.3"),
        Key::TissueNormal => smooth("veins", "tissue.normal=2.3"),
        Key::TissueFold => smooth("veins", "tissue.fold=0.35"),
        Key::TissueContraction => smooth("veins", "tissue.contraction=0.12"),
        Key::TissueGrown => always("veins", "tissue.grown=false"),
        Key::Gravity => smooth("veins", "load.gravity[2]=-0.65"),
        Key::G => smooth("veins", "load.g[2]=-0.35"),
        Key::Distributed => always("veins", "load.distributed=[0.1,0.1,-0.3]"),
        Key::Follower => smooth("following", "load.follower[1]=0.22"),
        Key::Couple => smooth("following", "load.couple[1]=0.12"),
        Key::CoupleFollows => always("following", "load.couple_follows=true"),
        Key::PointFollows => always("following", "load.point[0].follows=false"),
        Key::TipForce => smooth("veins", "load.tip_force[1]=0.25"),
        Key::TipMoment => smooth("twisted", "load.tip_moment[1]=0.15"),
        Key::PointVein => always("veins", "load.point[0].vein=2"),
        Key::PointAt => always("veins", "load.point[0].at=0.6"),
        Key::PointForce => smooth("veins", "load.point[0].force[2]=0.35"),
        Key::PointMoment => smooth("twisted", "load.point[0].moment[2]=0.25"),
        Key::PointMass => vec![
            row("veins", "load.point[0].mass=0.35", Acts::Always, true),
            // Without a weight: what is left is its inertia.
            row("moving", "load.point[0].mass=0.4", Acts::Inertia, false),
        ],
        Key::PointOffset => vec![
            row("beside", "load.point[0].offset[1]=0.12", Acts::Always, true),
            row(
                "beside",
                "load.point[1].offset=[0.05,0.0]",
                Acts::Always,
                false,
            ),
            // Without a weight: what is left is its inertia.
            row(
                "moving",
                "load.point[0].offset=[0.3,0.1]",
                Acts::Inertia,
                false,
            ),
        ],
        Key::LoadFactor => vec![
            row(
                "veins",
                "load.factor={at=[0.0],factor=[0.9]}",
                Acts::Always,
                false,
            ),
            row(
                "veins",
                "load.factor={at=[0.0,0.2],factor=[1.0,3.0]}",
                Acts::Motions,
                false,
            ),
            row(
                "following",
                "load.factor={at=[0.0,0.2],factor=[1.0,3.0]}",
                Acts::Motions,
                false,
            ),
        ],
        Key::PointFactor => vec![
            row(
                "veins",
                "load.point[0].factor={mean=0.7,amplitude=0.1,frequency=2.0}",
                Acts::Always,
                false,
            ),
            row(
                "twisted",
                "load.point[0].factor={at=[0.0,0.1],factor=[1.0,9.0]}",
                Acts::Motions,
                false,
            ),
            row(
                "following",
                "load.point[0].factor={at=[0.0,0.1],factor=[1.0,9.0]}",
                Acts::Motions,
                false,
            ),
        ],
        Key::PointFrom => motions("struck", "load.point[0].from=0.1"),
        Key::PointVelocity => motions("struck", "load.point[0].velocity=[0.0,2.0,-5.0]"),
        Key::TipHeld => always("pinned", "tip.held=clamped"),
        Key::TipPosition => vec![
            row("pinned", "tip.position[0]=0.91", Acts::Always, true),
            row(
                "pinned",
                "tip.position={at=[0.0,0.1],value=[[0.9,0.1,-0.1],[0.9,0.2,-0.1]]}",
                Acts::Motions,
                false,
            ),
        ],
        Key::TipAngles => smooth("jaws", "tip.angles=0.25"),
        Key::TipTwist => smooth("jaws", "tip.twist=0.35"),
        Key::GripVein => always("gripped", "grip[0].vein=2"),
        Key::GripAt => always("gripped", "grip[0].at=[0.3,0.5]"),
        Key::GripHeld => always("gripped", "grip[0].held=clamped"),
        Key::GripStiffness => vec![
            row("rollers", "grip[0].stiffness[2]=4.5", Acts::Always, true),
            row(
                "rollers",
                "grip[0].stiffness=[inf,inf,4.0]",
                Acts::Always,
                false,
            ),
        ],
        Key::GripTurnStiffness => smooth("rollers", "grip[1].turn_stiffness=2.5"),
        Key::FoundationStiffness => smooth("founded", "foundation.stiffness[2]=2.2"),
        Key::GripMove => vec![
            row("gripped", "grip[0].move[2]=0.06", Acts::Always, true),
            row(
                "gripped",
                "grip[0].move={at=[0.0,0.1],value=[[0.0,0.03,0.05],[0.0,0.03,-0.05]]}",
                Acts::Motions,
                false,
            ),
            row(
                "rollers",
                "grip[0].move={at=[0.0,0.1],value=[[0.0,0.03,0.05],[0.0,0.08,-0.05]]}",
                Acts::Motions,
                false,
            ),
            row(
                "gripped-in-wind",
                "grip[0].move[2]=0.04",
                Acts::Always,
                false,
            ),
        ],
        Key::Density => vec![
            row("veins", "dynamics.density=1.1", Acts::Always, false),
            row("moving", "dynamics.density=1.2", Acts::Inertia, false),
        ],
        Key::RotaryInertia => vec![row(
            "moving",
            "dynamics.rotary_inertia=0.05",
            Acts::Inertia,
            false,
        )],
        Key::RotaryInertia3 => vec![row(
            "flat",
            "dynamics.rotary_inertia_3=0.08",
            Acts::Inertia,
            false,
        )],
        Key::SectionRadius => vec![row(
            "moving",
            "dynamics.section_radius=0.4",
            Acts::Inertia,
            false,
        )],
        Key::ExternalDamping => motions("moving", "dynamics.external_damping=3.0"),
        Key::InternalDamping => motions("moving", "dynamics.internal_damping=0.02"),
        Key::Duration => motions("moving", "dynamics.duration=0.2"),
        Key::OutputInterval => motions("moving", "dynamics.output_interval=0.03"),
        Key::Clamped => motions("moving", "dynamics.clamped=false"),
        Key::Start => motions("moving", "dynamics.start=at-rest"),
        Key::GravityInTime => motions(
            "moving",
            "dynamics.gravity={at=[0.0,0.2],value=[[0.0,0.0,0.0],[0.0,0.0,-5.0]]}",
        ),
        Key::TipForceInTime => motions(
            "moving",
            "dynamics.tip_force={at=[0.0,0.2],value=[[0.0,0.0,0.0],[0.0,1.0,1.0]]}",
        ),
        Key::TipMomentInTime => motions(
            "moving",
            "dynamics.tip_moment={at=[0.0,0.2],value=[[0.0,0.0,0.0],[0.0,1.0,1.0]]}",
        ),
        Key::RestInTime => motions("moving", "dynamics.rest={at=[0.0,0.2],factor=[1.0,0.0]}"),
        Key::BaseInTime => motions(
            "moving",
            "dynamics.base={at=[0.0,0.1],move=[[0.0,0.0,0.0],[0.0,0.1,0.1]],turn=[[0.0,0.0,0.0],[0.0,0.3,0.0]]}",
        ),
        Key::WindVelocity => smooth("windy", "wind.velocity[1]=0.85"),
        Key::WindDensity => smooth("windy", "wind.density=1.3"),
        Key::WindDrag => smooth("windy", "wind.drag=2.2"),
        Key::WindWidth => smooth("windy", "wind.width=0.22"),
        Key::PhotoScale => photographs("photographed", "photo.scale=0.0101"),
        Key::PhotoX => photographs("photographed", "photo.x=21.0"),
        Key::PhotoY => photographs("photographed", "photo.y=51.0"),
        Key::PhotoRotation => photographs("photographed", "photo.rotation=0.02"),
        Key::PhotoRight => photographs("photographed", "photo.right=-x"),
        Key::PhotoUp => photographs("photographed", "photo.up=-z"),
        Key::RulerFrom => photographs("ruled", "photo.ruler_from=[1.0,0.0]"),
        Key::RulerTo => photographs("ruled", "photo.ruler_to=[101.0,0.0]"),
        Key::RulerLength => photographs("ruled", "photo.ruler_length=1.01"),
    }
}
