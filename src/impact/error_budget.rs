//! What enters the uncertainty of a result beside the scatter of the centres, with where each number comes from.
//!
//! What a recording shows of itself (the centres' scatter, duplicate frames, a swing) is worked out from it; here is what it
//! does not show. A number without a publication is from rendered recordings with known truth: centres and radii from
//! `examples/centre_errors`, swings from `tests/hard_lab`, shadows from `tests/top_view`, faded rims from recordings like those
//! of `tests/coverage`, which also asks whether all of it together is right: whether intervals hold the truth as often as they
//! say.

// ---- Centres in the picture ----------------------------------------------------------------------------------------------

/// No centre is better than this: rounding to 8 bits and the optics see to it, px.
pub const LEAST_CENTRE_STD_PX: f64 = 0.002;

/// In a picture that swings its edges, which the codec draws anew, tell each coordinate of the swing no better, px.
pub const SWING_STD_PX: f64 = 0.08;

/// Part of a swing that turns or smears the picture, which a shift does not take out.
pub const SWING_PART: f64 = 0.05;

/// How well the middle of a region that is no disc (a ball with its shadow) tells the ball's centre, in its radii.
pub const OVAL_CENTRE_STD_RADII: f64 = 0.15;

/// A shaded ball's outline is off towards the light by about this, px.
pub const OUTLINE_COMMON_STD_PX: f64 = 0.1;

/// Marks that turn draw the centres to and fro; all of them together are off by this part of what that scatters them by, along each axis. (Rendered balls of
/// two halves and with lines, R 15 to 34 px: root mean square 0.06 px of 0.12.)
pub const MARKED_COMMON_PART: f64 = 0.45;

/// What the model of the ball leaves out (a highlight's shape, the optics' real blur) shifts all centres by this, px.
pub const LEARNED_COMMON_STD_PX: f64 = 0.005;

/// Where the rim fades into the wall the outline says little of that side, and the light has to: of a ball with half of its rim
/// faded the centre is off by about this times a half, px.
pub const FADED_STD_PX: f64 = 0.12;

/// Standard deviation of the error that all centres share, px, of a ball beside which a shadow goes along that differs from the wall as much as the
/// ball does; of a fainter one, that part of it. What of the shadow lies behind the ball's rim is not seen (`tests/wild.rs`: 0.03 px where it is a
/// quarter, 0.12 px where it is twice as much).
pub const SHADOW_STD_PX: f64 = 0.08;

/// Part of what a codec displaces each centre by that lasts: it leaves the ball where it was predicted, in one direction while
/// the ball flies in one.
pub const LASTING_PART: f64 = 0.15;

/// Of what a codec displaces a ball by that is seen by its chroma, this part is common to all frames, and ...
///
/// Encoders spend little on chroma: a block that is skipped keeps that of the frame before, so that errors last. Rendered balls of a wall's luma, R 10 px,
/// H.264 at crf 12 to 18: all centres of a recording are off by up to 0.8 of their scatter.
pub const CHROMA_COMMON_PART: f64 = 0.7;

/// ... this part differs between the places of two impacts.
pub const CHROMA_PLACES_PART: f64 = 0.3;

/// What differs of the centres' common error between the places of two impacts (uneven light, another direction of motion),
/// where nothing displaces the centres, px.
pub const PLACES_STD_PX: f64 = 0.002;

/// A pixel that a person read off a picture, where its uncertainty is not given, px.
pub const READ_STD_PX: f64 = 1.0;

// ---- The ball's radius ---------------------------------------------------------------------------------------------------

/// Where the rim of a ball is in its blurred edge depends on the lens's line spread, on focus and on the light: the radius is
/// no better known than this, px, however many frames agree.
pub const EDGE_STD_PX: f64 = 0.05;

/// Of a ball with marks the radius is off by this times what they scatter its centres by. (25 rendered balls with dots, lines, seams and halves, R 8 to 31 px,
/// lossless to crf 20: of those whose centres scatter by more than 0.05 px root mean square 1.0; at crf 20 the radius is too small.)
pub const MARKED_RADIUS_PART: f64 = 1.0;

/// Outlines are at half of the edge's height, which shading and blur put up to this far from the rim, px.
pub const OUTLINE_RADIUS_STD_PX: f64 = 0.2;

// ---- The camera ----------------------------------------------------------------------------------------------------------

/// How far the optical axis may be from where the calibration has it, as a part of the picture's width: the principal
/// point of a lens that was not calibrated, and a camera that is not quite square to the floor (1 % is half a degree).
pub const AXIS_PART: f64 = 0.01;

/// Relative standard uncertainty of a distance given without one: where in its lens a camera has its pinhole is not known to
/// better.
pub const DISTANCE_RELATIVE_STD: f64 = 0.01;

// ---- The air -------------------------------------------------------------------------------------------------------------

/// Relative standard uncertainty of a smooth sphere's drag: formulas agree within 4 %, the air's density changes by more with
/// weather and height. Where felt or seams make more of it, the flight shows that.
pub const SPHERE_DRAG_RELATIVE_STD: f64 = 0.1;

/// Where the ball is not known the fitted drag goes as the square of the speed; a sphere's coefficient changes by about
/// this part over the speeds of an arc (0.39 to 0.45 between Reynolds numbers of 1500 and 50 000: Brown and Lawler 2003).
pub const SQUARE_LAW_STD: f64 = 0.07;

/// Where it is known, formulas for that change differ by this part (Clift and Gauvin 1970 against Brown and Lawler 2003).
pub const SPHERE_LAW_STD: f64 = 0.03;

/// Drag coefficient of a ball of unknown size or mass.
pub const USUAL_DRAG: f64 = 0.42;

/// Relative standard uncertainty of the lift of a ball whose spin is known: smooth spheres and golf balls have between 0.65
/// and 1.4 times a tennis ball's, and a range of that width has this standard deviation.
pub const KNOWN_SPIN_LIFT_STD: f64 = 0.22;

/// No ball has more times a tennis ball's lift than this.
pub const MOST_LIFT: f64 = 1.5;

/// Lift over drag that a ball may have which is said not to spin.
pub const NO_SPIN_LIFT_STD: f64 = 0.03;

/// Lift over drag where the spin is not known: about the spin ratio, up to 1/2.
pub const UNKNOWN_SPIN_LIFT_STD: f64 = 0.3;

// ---- The contact ---------------------------------------------------------------------------------------------------------

/// Speed against the floor where nothing shows it, m/s: a fall of 20 cm. A contact lasts as its fifth root.
pub const USUAL_IMPACT_M_S: f64 = 2.0;

/// Half the time of a contact without loss, s, of a ball of unknown size or mass: that of a small hard ball.
pub const HALF_CONTACT_S: f64 = 3.5e-5;

/// Standard deviation of that from ball to ball, s.
pub const HALF_CONTACT_STD_S: f64 = 3e-5;

/// Effective modulus of a hard ball on a hard floor, Pa: between steel on stone (45 GPa) and steel on steel (115 GPa).
pub const HARD_MODULUS_PA: f64 = 7e10;

/// Relative standard uncertainty of the contact time, which goes as E^(-2/5), if the modulus may as well be half or twice as
/// large (a rectangular distribution of its logarithm). What a soft ball takes more is not contained.
pub const CONTACT_TIME_RELATIVE_STD: f64 = 0.16;

/// A ball of less density than this may be rubber, plastic or hollow, kg/m³; metal, glass and stone are above.
pub const SOFT_DENSITY_KG_M3: f64 = 2000.0;

/// Effective modulus of a soft ball, Pa: a superball's. A golf ball has twenty times that, a tennis ball a fifth.
pub const SOFT_MODULUS_PA: f64 = 1e7;
