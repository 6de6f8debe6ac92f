//! The contact of a sphere with a floor that give way sideways, by a line of independent springs (the method of
//! dimensionality reduction, Popov and Hess; exact for Hertz's contact with the tangential histories of Cattaneo and Mindlin
//! between like bodies).
//!
//! # Equations
//!
//! Indentation d, springs at x on a line over the contact (E*, G* the stiffnesses of the contact, κ = G*/E*):
//!
//! ```text
//! u = d − x²/R        in contact where u > 0         f_z = E* u dx, e² times that while d falls
//! df_x = −G* dx (v_t − R ω) dt, then clipped to ± μ f_z
//! m v_n' = −Σ f_z     m v_t' = Σ f_x     k m R ω' = −Σ f_x
//! ```
//!
//! The normal motion does not depend on the rest and is known: with δ = d/d_max and τ = t v_n/d_max, δ' = ± √(1 − δ^(5/2)),
//! slowed by e while δ falls. In units of the greatest indentation for the springs (s = x/x_max), μ f_z for their forces
//! (q) and μ v_n/κ for the slip (σ):
//!
//! ```text
//! dq = −σ dτ,  |q| <= g (δ − s²)       g = 1 while δ grows, e² while it falls
//! σ' = λ Φ,   Φ = 15/8 ∫ q ds          λ = κ (1 + 1/k)
//! σ = ψ₁ = κ slip/(μ v_n) at first,  e_x = −σ/ψ₁ at the end
//! ```
//!
//! So the outcome depends on ψ₁, λ and e alone.
//!
//! # Method
//!
//! s = sin θ with θ in equal steps, which are the time steps as well: the edge of the contact is at the edge of a spring at the
//! end of each, and the end of the compression, where δ comes to rest, costs no accuracy. Velocity and displacement take turns
//! (leapfrog). A spring's clipped history depends only on where displacement and limit turn against each other, so the step in
//! which all that slip at the edge come to stick (σ passes the rate of the limit) is parted there. The error is of second order
//! then, and smooth enough for Richardson's extrapolation from two numbers of steps.
//!
//! Several ψ₁ go through at once: they share all but σ and q, and a processor takes them side by side.

use crate::rebound::model::ContactMoment;
use std::f64::consts::FRAC_PI_2;
use wide::f64x4;

/// Values of ψ₁ that go through at once.
pub const LANES: usize = 8;

/// One number for each ψ₁.
pub type Lanes = [f64; LANES];

/// Steps to the end of the compression of the coarser of two runs, for a contact no stiffer sideways than λ = 4: e_x is good to
/// 2e-5 then.
pub const STEPS: usize = 64;

/// λ up to which [`STEPS`] are enough: stiffer contacts swing to and fro faster, as √λ.
const SOFT: f64 = 4.0;

/// ψ₁ that stands for a slip of nothing, which has an outcome but no ratio.
const NEXT_TO_NOTHING: f64 = 1e-7;

/// ψ₁ up to which [`STEPS`] are not enough: the springs slip then only as they leave the contact, within fewer steps the smaller ψ₁ is.
const LATE_SLIP: f64 = 0.1;

/// Times [`STEPS`] at most. What is left where this is not enough, at ψ₁ below 0.005, is 5e-4 of a slip that is hardly there.
const MOST_STEPS: usize = 4;

/// Steps that a contact of this λ asks for at ψ₁.
pub fn steps(stiffness: f64, psi: f64) -> usize {
    steps_up_to(MOST_STEPS, stiffness, psi)
}

/// The same with no more than `most` times as many for a late slip.
fn steps_up_to(most: usize, stiffness: f64, psi: f64) -> usize {
    let late = (LATE_SLIP / psi).powf(0.75).ceil() as usize;
    let times = late.clamp(1, most).next_power_of_two();
    let usual = (STEPS as f64 * (stiffness / SOFT).sqrt().max(1.0)).ceil() as usize;
    // A stiff contact has small steps as it is.
    (STEPS * times).max(usual)
}

/// How the contact of one ψ₁ goes on.
pub fn path(psi: f64, stiffness: f64, restitution: f64) -> Vec<ContactMoment> {
    let psi = psi.max(NEXT_TO_NOTHING);
    let line = Line::new(2 * steps(stiffness, psi));
    let mut path = Vec::new();
    let end = run(&[psi; LANES], stiffness, restitution, &line, |moment| {
        path.push(ContactMoment {
            time: moment.time,
            compression: moment.indentation,
            rate: moment.rate,
            tangential_share: psi - moment.slip[0],
        });
    });
    let whole = psi - end[0];
    for moment in &mut path {
        moment.tangential_share /= whole;
    }
    path
}

/// e_x for each ψ₁, in as many [`steps`] as each asks for.
pub fn tangential_restitutions(psi: &[f64], stiffness: f64, restitution: f64) -> Vec<f64> {
    by_steps(psi, stiffness, restitution, |psi| steps(stiffness, psi))
}

/// λ above which [`rougher`] takes no more steps: twenty a swing are left at λ = 180, where nothing tells κ any more.
const STIFF: f64 = 16.0;

/// [`MOST_STEPS`] of [`rougher`].
const MOST_STEPS_ROUGHLY: usize = 2;

/// As [`tangential_restitutions`], in half as many steps and fewer where λ is large or the slip hardly there: a quarter of the work and less for
/// 6e-5 in place of 2e-5, about 1e-3 of contacts that are as good as rigid, and of a slip of ψ₁ below 0.05.
pub fn rougher(psi: &[f64], stiffness: f64, restitution: f64) -> Vec<f64> {
    by_steps(psi, stiffness, restitution, |psi| {
        steps_up_to(MOST_STEPS_ROUGHLY, stiffness.min(STIFF), psi) / 2
    })
}

fn by_steps(psi: &[f64], stiffness: f64, restitution: f64, steps: impl Fn(f64) -> usize) -> Vec<f64> {
    let mut order: Vec<usize> = (0..psi.len()).collect();
    order.sort_by(|&a, &b| psi[a].total_cmp(&psi[b]));
    let mut found = vec![0.0; psi.len()];
    for same in order.chunk_by(|&a, &b| steps(psi[a]) == steps(psi[b])) {
        let at: Vec<f64> = same.iter().map(|&i| psi[i]).collect();
        let e_x = in_steps(&at, stiffness, restitution, steps(at[0]));
        for (&i, e_x) in same.iter().zip(e_x) {
            found[i] = e_x;
        }
    }
    found
}

/// e_x for each ψ₁, extrapolated from `steps` and twice as many.
pub fn in_steps(psi: &[f64], stiffness: f64, restitution: f64, steps: usize) -> Vec<f64> {
    let lines = [Line::new(steps), Line::new(2 * steps)];
    let mut found = Vec::with_capacity(psi.len());
    for some in psi.chunks(LANES) {
        let at: Lanes = std::array::from_fn(|i| some.get(i).unwrap_or(&some[0]).max(NEXT_TO_NOTHING));
        let [coarse, fine] = lines
            .each_ref()
            .map(|line| run(&at, stiffness, restitution, line, |_| ()));
        let e_x = |i: usize| (coarse[i] - 4.0 * fine[i]) / (3.0 * at[i]);
        found.extend((0..some.len()).map(e_x));
    }
    found
}

/// What does not depend on ψ₁, λ or e: springs and time steps.
pub struct Line {
    /// s² of each spring, from the middle outwards, for four lanes: making four of one in the inner loop costs more than the arithmetic.
    square: Vec<f64x4>,
    /// 15/8 of its width.
    width: Vec<f64x4>,
    /// δ at the ends of the steps.
    indentation: Vec<f64>,
    /// δ' there.
    speed: Vec<f64>,
    /// Length of each step in τ.
    duration: Vec<f64>,
    /// What part of its step is over when the spring that comes into contact in it does.
    entry: Vec<f64>,
}

impl Line {
    /// With so many steps to the end of the compression, and as many springs.
    pub fn new(steps: usize) -> Self {
        let step = FRAC_PI_2 / steps as f64;
        // dτ/dθ = (dδ/dθ) / δ', whose root of 1 − s goes out.
        let slowness = |theta: f64| {
            let s = theta.sin();
            let powers = 1.0 + s * (1.0 + s * (1.0 + s * (1.0 + s)));
            2.0 * s * ((1.0 + s) / powers).sqrt()
        };
        // Gauss's rule of two points.
        let time = |from: f64, to: f64| {
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            let off = half / 3_f64.sqrt();
            half * (slowness(middle - off) + slowness(middle + off))
        };
        let edges: Vec<f64> = (0..=steps).map(|j| step * j as f64).collect();
        let squares = edges.iter().map(|theta| theta.sin().powi(2));
        let mut line = Self {
            square: Vec::with_capacity(steps),
            width: Vec::with_capacity(steps),
            indentation: squares.clone().collect(),
            speed: squares.map(|d| (1.0 - d.powf(2.5)).max(0.0).sqrt()).collect(),
            duration: Vec::with_capacity(steps),
            entry: Vec::with_capacity(steps),
        };
        for edge in edges.windows(2) {
            let middle = 0.5 * (edge[0] + edge[1]);
            let whole = time(edge[0], edge[1]);
            line.square.push(f64x4::splat(middle.sin().powi(2)));
            line.width
                .push(f64x4::splat(15.0 / 8.0 * (edge[1].sin() - edge[0].sin())));
            line.duration.push(whole);
            line.entry.push(1.0 - time(middle, edge[1]) / whole);
        }
        line
    }

    /// Moves the springs `q` by −`moved` and clips them to `g` (δ − s²); Φ.
    #[inline]
    fn clip(&self, q: &mut [Forces], moved: &Lanes, g: f64, indentation: f64) -> Lanes {
        let moved = Forces::new(moved);
        let (g, indentation) = (f64x4::splat(g), f64x4::splat(indentation));
        let mut sum = Forces::default();
        for ((q, square), width) in q.iter_mut().zip(&self.square).zip(&self.width) {
            let most = g * (indentation - *square);
            for i in 0..REGISTERS {
                let kept = within(q.0[i] - moved.0[i], most);
                q.0[i] = kept;
                sum.0[i] += *width * kept;
            }
        }
        sum.lanes()
    }

    /// The same with an indentation for each lane; springs that it leaves are free.
    fn clip_at(&self, q: &mut [Forces], moved: &Lanes, g: f64, indentation: &Lanes) {
        let (moved, indentation) = (Forces::new(moved), Forces::new(indentation));
        let g = f64x4::splat(g);
        for (q, square) in q.iter_mut().zip(&self.square) {
            for i in 0..REGISTERS {
                let most = g * (indentation.0[i] - *square).fast_max(f64x4::ZERO);
                q.0[i] = within(q.0[i] - moved.0[i], most);
            }
        }
    }
}

#[inline]
fn within(x: f64x4, most: f64x4) -> f64x4 {
    x.fast_min(most).fast_max(-most)
}

/// The force of one spring for each ψ₁, four in a register: half of what a fit takes is spent on these, and a compiler takes an array one by one.
#[derive(Debug, Clone, Copy, Default)]
struct Forces([f64x4; REGISTERS]);

const REGISTERS: usize = LANES / 4;

impl Forces {
    #[inline]
    fn new(lanes: &Lanes) -> Self {
        let [a, b, c, d, e, f, g, h] = *lanes;
        Self([f64x4::new([a, b, c, d]), f64x4::new([e, f, g, h])])
    }

    #[inline]
    fn lanes(&self) -> Lanes {
        let [[a, b, c, d], [e, f, g, h]] = self.0.map(f64x4::to_array);
        [a, b, c, d, e, f, g, h]
    }
}

/// What goes on while the bodies touch.
struct SlippingLine<'a> {
    line: &'a Line,
    stiffness: f64,
    q: Vec<Forces>,
    slip: Lanes,
    sum: Lanes,
    time: f64,
}

/// A moment of a contact, for the path: τ, δ, the rate of δ, and σ of the lanes.
pub struct Moment<'a> {
    /// τ since the first touch.
    pub time: f64,
    /// δ.
    pub indentation: f64,
    /// dδ/dτ.
    pub rate: f64,
    /// σ.
    pub slip: &'a Lanes,
}

impl SlippingLine<'_> {
    /// One step between two indentations `from`, `to`, whose rates are `rates` times `g`, over `duration`.
    fn step(&mut self, from: (f64, f64), to: (f64, f64), duration: f64, g: f64, active: (usize, usize)) {
        let lambda = self.stiffness;
        let (mut middle, mut moved) = ([0.0; LANES], [0.0; LANES]);
        let mut first = [0.0; LANES];
        let mut until = [from.0; LANES];
        let mut parted = false;
        for lane in 0..LANES {
            let push = lambda * self.sum[lane];
            middle[lane] = self.slip[lane] + 0.5 * duration * push;
            moved[lane] = middle[lane] * duration;
            let end = 2.0 * middle[lane] - self.slip[lane];
            if let Some(part) = passes(self.slip[lane], end, g * from.1.abs(), g * to.1.abs()) {
                let time = part * duration;
                parted = true;
                first[lane] = time * (self.slip[lane] + 0.5 * time * push);
                until[lane] += time * (from.1 + 0.5 * part * (to.1 - from.1));
            }
        }
        if parted {
            self.line.clip_at(&mut self.q[..active.0], &first, g, &until);
            // A spring that comes into contact in this step is not held by anything before.
            for q in &mut self.q[active.0..active.1] {
                let lanes = q.lanes();
                *q = Forces::new(&std::array::from_fn(|lane| lanes[lane] - first[lane]));
            }
            for lane in 0..LANES {
                moved[lane] -= first[lane];
            }
        }
        self.sum = self.line.clip(&mut self.q[..active.1], &moved, g, to.0);
        self.slip = std::array::from_fn(|lane| middle[lane] + 0.5 * duration * lambda * self.sum[lane]);
        self.time += duration;
    }
}

/// At what part of a step |σ| passes the rate of the limit.
fn passes(from: f64, to: f64, rate_from: f64, rate_to: f64) -> Option<f64> {
    [1.0, -1.0].into_iter().find_map(|sign| {
        let (before, after) = (sign * from - rate_from, sign * to - rate_to);
        (before * after < 0.0).then(|| before / (before - after))
    })
}

/// σ at the end, for ψ₁ in each lane; `watch` is called at the start and after each step.
pub fn run(
    psi: &Lanes,
    stiffness: f64,
    restitution: f64,
    line: &Line,
    mut watch: impl FnMut(&Moment<'_>),
) -> Lanes {
    let steps = line.duration.len();
    let mut motion = SlippingLine {
        line,
        stiffness,
        q: vec![Forces::default(); steps],
        slip: *psi,
        sum: [0.0; LANES],
        time: 0.0,
    };
    let moment =
        |motion: &SlippingLine<'_>, indentation: f64, rate: f64, watch: &mut dyn FnMut(&Moment<'_>)| {
            watch(&Moment {
                time: motion.time,
                indentation,
                rate,
                slip: &motion.slip,
            });
        };
    moment(&motion, 0.0, 1.0, &mut watch);
    for j in 0..steps {
        let duration = line.duration[j];
        // It moves with the rest only from when it touches.
        let moved = |lane: usize| {
            let push = 0.5 * duration * stiffness * motion.sum[lane];
            (motion.slip[lane] + push) * duration * line.entry[j]
        };
        motion.q[j] = Forces::new(&std::array::from_fn(moved));
        let at = |i: usize| (line.indentation[i], line.speed[i]);
        motion.step(at(j), at(j + 1), duration, 1.0, (j, j + 1));
        moment(&motion, line.indentation[j + 1], line.speed[j + 1], &mut watch);
    }
    if restitution > 0.0 {
        let g = restitution * restitution;
        motion.sum = line.clip(&mut motion.q, &[0.0; LANES], g, 1.0);
        for j in (0..steps).rev() {
            let at = |i: usize| (line.indentation[i], -restitution * line.speed[i]);
            motion.step(at(j + 1), at(j), line.duration[j] / restitution, g, (j, j));
            moment(
                &motion,
                line.indentation[j],
                -restitution * line.speed[j],
                &mut watch,
            );
        }
    }
    motion.slip
}
