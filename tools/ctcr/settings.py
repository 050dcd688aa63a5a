"""Every tuning value of fits and diagnosis: its unit, and why it has that value. Nothing here depends on the data.

Use it as `settings.NAME`. Limits of what is printed or drawn stand where they are used.
"""

# ---- Shared: one meaning, one value

SIGNIFICANCE = 0.01  # p-value below which the noise as stated does not explain a residual
OUTLIER_WEIGHT = 0.3  # robust weight below which a reading counts as an outlier: 1 plain, 0 not fitted
SAYS_NOTHING = 0.9  # posterior over prior standard deviation from which the data say nothing of a parameter
MOVED_FAR = 2.0  # prior standard deviations beyond which a fitted value contradicts the robot file

# ---- Model: numerical errors that stay far below the tracker's noise

STEPS = 2  # integration steps per segment, at least
MOST_STEPS = 16  # ... and at most: no known robot needs more
INTEGRATION_ERROR = 0.25  # of integration errors over all rows: shifts no parameter by more than half its sd
INTEGRATION_ERROR_COARSE = 1.0  # the same where log evidences are only compared: their error is a half of it
INTEGRATION_SAMPLE = 300  # rows on which integration errors are estimated
DIFFERENCE_STEP = 1e-4  # [prior sd] of central differences of a user's functions
POSITION_STEP, ROTATION_STEP = 1e-6, 1e-5  # [m], [rad] of central differences by the sensor's pose
PROFILE_STEP = 1e-3  # [prior sd] of differences of whole predictions, which carry solver tolerance
PROFILE_STEPS = 16  # integration steps per segment, at least, of tubes with profiles: these change within a segment

# ---- Audit of a table, before any physics

ONE_ROLL = 0.8  # mean length of the unit vectors of the rolls, from which one roll describes all readings
SPIKE_LEAP = 2.0  # leap of a spike over the distance that the model moves the tip there
SPIKE_RETURN = 0.5  # distance between the readings before and after a spike, over its leap
SPIKE_VISIBLE = 10.0  # leap of a spike over the noise of a difference of readings
LONG_STEP = 1.5  # length or pause of a step over the usual one of the run, from which it may hide a detour
SAME_JOINTS = 0.01  # distance in joint space over the usual step, below which two rows have the same joints
SAME_SIDE = 0.5  # cosine of two steps that arrive from the same side
STRAIGHT_ON = 0.9  # cosine of two steps that continue straight on
VISITS_DIFFER = 4.0  # distance of two visits over the noise of their difference, from which they differ
DETOUR_SIGNIFICANCE = 0.01  # p-value below which missing motion is added to the table

# ---- Noise of the tracker

CORRELATION_LENGTH = 0.1  # [m] over which the smooth field error changes: the size of a workspace, as of an Aurora
FIELD_PARTS = (1.0, 0.3, 0.1, 0.0)  # parts of the stated field error that are tried, halves of a decade apart

# ---- Joint fit

FEW_ROWS = 300  # rows of a first fit where there are twice as many: enough to find the basin of every parameter
TOLERANCE = 0.02  # [log evidence] of a converged fit: far below what decides anything
COARSE = 0.5  # [log evidence] tolerance of fits that only find a start, or tell models apart
ITERATIONS = 50  # by which a fit has converged, or never will
STARTS = 3  # starts that are compared
FRICTION_PATH_CHANGE = 0.005  # [rad] of relative torsion angle below which the friction path is solved
FRICTION_PATH_ROUNDS = 10  # fits, each followed by a solution of the friction path, at most
FRICTION_PATH_ITERATIONS = 2  # of a fit whose friction path still changes much

KINKED = ".curved_length"  # parameters in which chi-square has a kink: where the curve just reaches the plate
ONE_SIDED_WIDTH = 2.0  # [sd] at which the sides of a kink are judged
ONE_SIDED_WIDEN = 1.5  # factor of the search along a side, and sd from which a side is flat over the symmetric one
ONE_SIDED_UNSEEN = 0.99  # posterior over prior sd from which a curve may lie behind the plate altogether
ONE_SIDED_GAIN = 0.5  # log evidence that a restart across a kink must gain

FRAME_PRIOR_WIDER = 10.0  # prior sd of the frame of a run over that of the robot file's frame
FRAME_ALIGNMENTS = 6  # Gauss-Newton steps that align the frames of the runs before the first fit
FRAME_STARTS = 4  # starts of a fit with frames of their own, which make room for other minima

# ---- Folds: runs, or where there are too few of them, blocks of time or regions of joint space

FEWEST_RUNS = 4  # from which runs are kept together: fewer cannot be split into a fitted and a judged part
FOLDS = 4  # of a cross-validation: three quarters are fitted, one is judged
TIME_BLOCKS = 12  # into which a single run is divided: three for each fold
HELD_OUT_ORDER = (2, 3, 1, 0)  # which of every four groups is held out: runs often alternate in direction or load
MOST_UNDETERMINED = 0.1  # mean square error that the fitted groups may leave in a held-out one, over that of the jitter
EXCHANGES = 12  # exchanges of held-out groups, at most

# ---- Calibration command

NEARLY_EXPLAINED = 1.5  # reduced chi-square up to which the smooth field error is still accepted as the noise
CROSS_VALIDATION_ROWS = 5000  # rows beyond which one fold is held out instead of each in turn: to save time
HALVES_ROWS = 400  # rows at which the models of two halves are compared
HALVES_DRAWS, HALVES_SEED = 24, 1  # of the posterior: the RMS that noise gives is then known to 15 %
RUN_OFFSET_SIGNIFICANCE = 0.0125  # p-value below which runs have offsets of their own
FRAMES_BEYOND = 4.0  # RMS error over the expected one, from which frames for each run may be the reason,
FRAMES_LEAVE = 0.5  # ... if they leave less than this part of it

# ---- Diagnosis

LINEARISATION_ROWS = 1500  # rows by whose derivatives candidates are screened where there are twice as many or more
INFLATION_EXPLAINED = 1.2  # inflation of the noise beyond which the model certainly does not explain the readings
FIRST_ROW_EVIDENCE = 5.0  # log evidence that decides how the robot came to its first row
