"""Every tuning value of comparisons, fits and diagnosis: its unit, and why it has that value. None depends on the data.

Use it as `settings.NAME`. Limits of what is printed or drawn stand where they are used.
"""

from math import pi

# ---- Shared: one meaning, one value

SIGNIFICANCE = 0.01  # p-value below which noise as stated, or chance, does not explain what readings show
OUTLIER_WEIGHT = 0.3  # robust weight below which a reading counts as an outlier: 1 plain, 0 not fitted
UNDETERMINED = 0.9  # posterior over prior standard deviation from which the data do not determine a parameter
JOINT_LEVER = 0.02  # [m] of insertion that moves the tip about as far as one radian of rotation
LOAD_LEVER = 1e-3  # [N] that counts as much as a radian: readings under other loads are never near
MOVED_FAR = 2.0  # prior standard deviations beyond which a fitted value contradicts the robot file

# ---- Model: numerical errors that stay far below the tracker's noise

STEPS = 2  # factor on the integration steps of every segment, at least
MOST_STEPS = 16  # ... and at most: no known robot needs more
INTEGRATION_ERROR = 0.25  # chi-square of integration errors over all rows: shifts no parameter by more than half its sd
INTEGRATION_ERROR_COARSE = 1.0  # the same where log evidences are only compared: their error is a half of it
INTEGRATION_SAMPLE = 300  # rows on which integration errors are estimated
DIFFERENCE_STEP = 1e-4  # [prior sd] of central differences of a user's functions
POSITION_STEP, ROTATION_STEP = 1e-6, 1e-5  # [m], [rad] of central differences by the sensor's pose
PROFILE_STEP = 1e-3  # [prior sd] of differences of whole predictions, which carry solver tolerance
PROFILE_STEPS = 16  # the same factor, at least, for tubes with profiles: these change within a segment

# ---- Audit of a table, before any physics

ONE_ROTATION = 0.8  # mean cosine of the angles by which readings miss the best rotation of the sensor, from which it
# describes them all
ANY_ANGLE = pi / 3**0.5  # [rad] standard deviation of an angle of which nothing is known
PLACINGS = 5  # of an unknown sensor and of the tracker frame in turn: only a start of a fit
SENSOR_BESIDE = 0.05  # [m] standard deviation of the place of a sensor of which nothing is known: a body of markers is
# some centimetres large
SPIKE_LEAP = 2.0  # leap of a spike over the distance that the model moves the tip there
SPIKE_RETURN = 0.5  # distance between the readings before and after a spike, over its leap
SPIKE_VISIBLE = 10.0  # leap of a spike over the noise of a difference of readings
LONG_STEP = 1.5  # length or pause of a step over the usual one of the run, from which it may hide a detour
SAME_JOINTS = 0.01  # distance in joint space over the usual step, below which two rows have the same joints
SAME_SIDE = 0.5  # cosine of two steps that arrive from the same side
STRAIGHT_ON = 0.9  # cosine of two steps that continue straight on
VISITS_DIFFER = 4.0  # distance of two visits over the noise of their difference, from which they differ

# ---- Comparison of readings with the model

LEVEL = 0.05 / 4  # p-value of a finding: four tests (shift, runs, direction, dependence) on noise alone find one in 5 %
STOP_AND_GO_S = 1.0  # [s] between readings, beyond which they are stops, whose speed is not in the table
LONG_PAUSE_S = 3600.0  # [s] between readings of a run, from which somebody may have switched the robot off
REVERSAL = 2e-4  # part of its whole range by which a joint that reverses comes back: less is encoder noise or dither
CLEAR_DELAY = 0.2  # fraction of the squared hysteresis that a delay must explain to be mentioned

REST = 20e-6  # [m] of scaled joint distance, within which rows are one stop: above the noise of encoders
STILL = 1e-6  # [m] of scaled joint distance, up to which a row stands where the one before it stood
SAME_VISIT_DECIMALS = 4  # of joint space [rad] in which visits of two runs agree
PROBES = 500  # readings by which a typical number or distance of neighbours is estimated: to save time
PASS_APART = 0.25  # usual joint steps by which two passes through the same joints may miss each other,
PASS_APART_BOUNDS = (0.1e-3, 0.5e-3)  # [m] ... but no less than the first and no more than the second
LONGEST_LINK = 3.0  # usual joint steps over which errors are interpolated at most,
LONGEST_LINK_TURN = 0.2  # ... and part of the lever arm: about 0.2 rad of rotation
MOST_NEIGHBOURS = 300_000  # pairs of visits that are looked up: their RMS is known to 0.2 %; time and memory
FEWEST_PAIRS = 5  # of visits from the same direction, below which the sensor jitter is taken from elsewhere
FEWEST_FREEDOM = 10  # degrees of freedom of the scatter at rest, from which it serves as the sensor jitter
NOTABLE = 1.5  # difference of visits over the stated jitter, below which it is not reported
OUTLYING_PAIR = 1e-5  # probability by noise below which the difference of two visits is an outlier
DENSE_STREAM = 20  # pairs of visits a segment, beyond which neighbours are not independent

DEPENDENCE_ROWS = 6000  # that are examined, evenly spread: to save time
DEPENDENCE_BLOCKS = 24  # into which more runs are grouped: the cost grows with their square
FEWEST_BLOCKS = 6  # runs that serve as blocks: of fewer, parts of the table take their place
REGIONS = 16  # of joint space that are such parts, a power of two
PATH_SEGMENTS = 12  # of time, as such parts of pairs of visits
RIDGES = (0.01, 0.3)  # of which the better one counts, for chance as well; over the mean square of a column
SIGN_TRIALS = 1999  # random signs of the blocks, which show what chance does: resolves p-values far below LEVEL
HARMONICS = 3  # of an angle, in its richer curve
WAVES = 4  # half waves over the range of another quantity, in its richer curve
MOST_DEPENDENCES = 5  # one found after the other: later ones are hardly causes
LEAST_DEPENDENCE = 0.01  # fraction of the squared error that a quantity must predict
SAME_ERROR = 0.95  # correlation of two fitted errors, from which the data do not tell the quantities apart
MAIN_AXIS = 0.7  # fraction of the squared fit, from which one axis is named

GROSS_TURN_DEG = 10.0  # [deg] of a tracker frame that is fitted before anything else is examined,
GROSS_TURN_EXPLAINED = 0.3  # ... if it explains this fraction of the squared error that the shift leaves
OUTLYING_RUN = 5.0  # robust RMS of all runs beyond which the mean error of a run may be an outlier,
BEYOND_MOTION = 2.0  # ... and is, where it differs from errors at near joints by this many times their distance

# ---- Noise of the tracker

CORRELATION_LENGTH = 0.1  # [m] over which the smooth field error changes: about the size of a workspace
JITTER_KNOWN = 0.1  # standard deviation of the logarithm of the stated jitter: data sheets give two digits at best
FIELD_PARTS = (1.0, 0.3, 0.1, 0.0)  # parts of the stated field error that are tried, halves of a decade apart

# ---- Joint fit

# A table of a part of the readings leaves rows out where the joints move straight on.
# [rad], [m] by which they may miss that motion, as in friction/path_nodes.hpp of the library: friction slips at 5e-3
PATH_STRAIGHT = {"alpha": 1.5e-3, "beta": 2e-6}
PATH_STEP = {"alpha": 0.035, "beta": 1e-3}  # [rad], [m] over which friction changes the torsion of tubes linearly
FEW_ROWS = 300  # rows of a first fit where there are twice as many: enough to find the basin of every parameter
FEW_PART = 0.1  # of very many rows, fitted before all of them: its steps cost a tenth
TOLERANCE = 0.02  # [log evidence] of a converged fit: far below what decides anything
COARSE = 0.5  # [log evidence] tolerance of fits that only find a start, or tell models apart: less tells nothing
ITERATIONS = 50  # by which a fit has converged, or never will
STARTS = 3  # starts that are compared
FRICTION_PATH_CHANGE = 0.005  # [rad] of relative torsion angle below which the friction path is solved
FRICTION_PATH_ROUNDS = 10  # fits, each followed by a solution of the friction path, at most
FRICTION_PATH_ITERATIONS = 2  # of a fit whose friction path still changes much
WIDENINGS = 5  # fits, each followed by new scales on the stated uncertainties, at most: two or three suffice
WIDEST = 1000.0  # factor on a stated uncertainty, at most: beyond it lies no data sheet, but another unit

KINKED = ".curved_length"  # parameters in which chi-square has a kink: where the curve just reaches the plate
ONE_SIDED_WIDTH = 2.0  # [sd] at which the sides of a kink are judged
ONE_SIDED_WIDEN = 1.5  # factor of the search along a side, and sd from which a side is flat over the symmetric one
ONE_SIDED_UNSEEN = 0.99  # posterior over prior sd from which a curve may lie behind the plate altogether

SESSION_EXPLAINED = 0.25  # fraction of the unexplained chi-square that terms of each run must explain: less is physics
SESSION_PRIOR_WIDER = 10.0  # prior sd of the frame and the homes of a run over that of the robot file's
# Of that sd, which the scatter of the runs about the typical one may have: from less than the file states to a tracker
# that stood elsewhere in the room.
SESSION_PARTS = (30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03)
SESSION_ALIKE = 0.8  # fraction explained over the best one's, from which other parameters may as well differ by run
SESSION_ALIGNMENTS = 6  # Gauss-Newton steps that align the runs before the first fit
SESSION_ROWS = 600  # rows on which runs are compared, spread over all runs

# ---- Folds: runs, or where there are too few of them, blocks of time or regions of joint space

FOLDS = 4  # of a cross-validation: three quarters are fitted, one is judged
FEWEST_RUNS = FOLDS  # from which runs are kept together: one for each fold
TIME_BLOCKS = 3 * FOLDS  # into which a single run is divided: three for each fold
HELD_OUT_ORDER = (2, 3, 1, 0)  # which of every four groups is held out: runs often alternate in direction or load
MOST_UNDETERMINED = 0.1  # mean square error that the fitted groups may leave in a held-out one, over that of the jitter
EXCHANGES = 12  # exchanges of held-out groups, at most

# ---- Calibration command

NEARLY_EXPLAINED = 1.5  # reduced chi-square up to which the smooth field error is still accepted as the noise
CROSS_VALIDATION_ROWS = 5000  # rows that judge noises, held-out errors and halves at most: to save time
HALVES_ROWS = 400  # rows at which the models of two halves are compared
HALVES_DRAWS, HALVES_SEED = 24, 1  # of the posterior: the RMS that noise gives is then known to 15 %
HALVES_AGREE = 1.5  # RMS difference of two halves over that by noise, up to which noise explains it

# ---- Diagnosis: evidence for an effect

DECISIVE = 5.0  # log evidence that decides between two models: odds of 150 to 1
TIE = 3.0  # log evidence below which candidates cannot be told apart, nor one from none: odds of 20 to 1
MAX_EFFECTS = 6  # more causes than that no session can tell apart

# ---- Diagnosis: course of the selection

LINEARISATION_ROWS = 1500  # rows by whose derivatives candidates are screened where there are twice as many or more
REFITS = 6  # effects that are refitted, the best ones by linearisation: the true one was always among them
NEAR = 0.2  # linearised gain over the best one, below which a candidate is not refitted
REFIT_GAIN = 1.0  # linearised log evidence below which no candidate is refitted
REFIT_VARIANTS = 2  # of an effect that are refitted
FIRST_ITERATIONS = 5  # of a refit: enough to see whether a candidate contends
CONTENDS = 0.5  # gain over the best one, above which a refit goes on until it has converged
IN_REACH = 0.8  # gain over the best one on a part of many rows, below which a candidate is not refitted to all
INFLATION_EXPLAINED = 1.2  # inflation of the noise beyond which the model certainly does not explain the readings
INFLATION_WRONG = 3.0  # inflation from which the form of an effect is hardly right: other laws and amplitudes are tried
NOISE_BETTER = 0.9  # RMS error of left-out runs over the usual one, at which another noise is used for prediction

# ---- Diagnosis: searches for a start

MOMENTS_AT_A_TIME = 40  # moments that are tried at a time; then those between the neighbours of the best
SURFACE_OUTSIDE = (0.6, 0.75, 0.9, 0.97)  # fractions of the tips that a surface leaves outside
SURFACE_ELEVATIONS = (-60, -30, 0, 30, 60, 90)  # [deg] of normals of surfaces that are tried,
SURFACE_AZIMUTHS = 12  # ... each in so many directions around the insertion axis: all 30 deg apart
FEWEST_CONTACTS = 5  # tips that must touch a surface
SOURCE_DISTANCES = (1.1, 1.5, 2.2, 3.5)  # of a source from the centre of the readings, over that of far readings
SOURCE_DIRECTIONS = 48  # in which a source is tried: 30 deg apart
SOURCE_FAR = 0.95  # quantile of the distances from that centre that far readings have
SOURCE_STARTS, SOURCE_EVALUATIONS = 3, 150  # simplex searches for a source, and evaluations of each
SOURCE_SIMPLEX = (0.2, 0.5)  # its edges: position over the distance of far readings, coils over their prior sd
ADDED_STARTS = 2  # starts of an effect that `ctcr add` tries, with and without outliers

# ---- Diagnosis: nuisance errors that no robot file can hold

SEGMENTS = 2  # of each run, at least: out and back
SEGMENT_ROWS = 12  # in each of more segments, at least
MOST_SEGMENTS = 96  # of more runs several share one, as each is a column of all readings
SEGMENTS_AT_ONCE = 16  # columns that are made at a time: memory
LAG_SPREAD = 0.2  # prior standard deviation of the lag of a segment, over the delay
LAG_SCATTER = (0.0, 1 / 8, 1 / 4, 1 / 2, 1.0)  # sd of the lag of a single reading over it, that are tried
LAG_CORRELATION = (0.0, 1 / 16, 1 / 4)  # correlation times of lags over the session that are tried
LAGS_LEAVE = 0.5  # fraction of the unexplained chi-square that lags may leave, if they are to be its cause
ONE_FRAME = 0.3  # by how much lags may differ from one frame of the tracker, over it, and still be called so
SMOOTH_LENGTHS = (0.025, 0.04, 0.07)  # [m] correlation lengths of a smooth field error that are tried
SMOOTH_SIZES = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4)  # [m] standard deviations an axis that are tried

# ---- Diagnosis: outliers

SURPRISE = 3.0  # error over its expected size, from which a reading is an outlier
TRACKER_OUTLIERS = 0.03  # fraction of readings that are errors of the tracker, at most
OUTLIER_SIGNIFICANCE = 1e-3  # p-value below which so many outliers, or outliers that agree, are no chance
MOST_OF_A_RUN = 0.5  # fraction of outliers in a run from which it is the run that is unlike the others
SNAP_ERROR = 0.1  # fraction of an isolated outlier's error that another equilibrium leaves, where it is a snap
SNAPS_LOOKED_AT = 300  # readings of a table, those of the largest errors, for which other equilibria are sought
CLUSTER_COSINE, CLUSTER_CHANCE = 0.5, 0.25  # between errors of neighbours that agree; how often it is that by chance
CLUSTER_ROWS = 4  # outliers of a cluster that only agree in direction, at least

# ---- Diagnosis: probabilities of explanations

OUTSIDE_CATALOGUE = 0.1  # prior odds of a cause outside the catalogue
SECOND_CAUSE = 0.5  # prior odds of a second cause beside the first
IMPLAUSIBLE = 0.02  # probability that the values of a cause lie beyond their soft bounds by two standard deviations
REJECTION_MISSED = 0.1  # probability that the test of the residual does not see a cause that is missing
SURE = 0.9  # probability from which effects are called identified

# ---- Diagnosis: held-out runs and varying-coefficient model, in fractions of unexplained chi-square of held-out runs

TURNS = 2  # quarters that are held out in turn where nothing was found and the held-out one has new errors
MOST_UNCERTAIN = 1.5  # expected square error of a held-out run over that of fitted ones, above which it judges nothing
VARYING_ROWS = 400  # rows of the model where there are twice as many or more
VARYING_MOST = 4  # variations, one found after the other
VARYING_EXPLAINED = 0.3  # that all variations must explain together
VARYING_NEGLIGIBLE = 0.05  # for which no further variation is named
VARYING_AT_ONCE = 2_000_000  # numbers that are made at a time: memory
MOST_TEETH = 24  # of a wheel whose errors are tried

# ---- Plan of further runs

PLAN_POOL = 120  # random runs to choose from
PLAN_TRIES = 100  # random runs that are drawn for each one that the joints allow
PLAN_STOP_S = 2.0  # [s] from stop to stop
PLAN_STOPS = 4  # of a run on the way out; it returns through the same, so that each is reached from both sides

# ---- Conventions of a table, before any physics

SENSOR_JUMP = 0.01, 0.2  # [m], [rad] from where the file has the sensor, beyond which no mounting error lies
SENSOR_ROWS = 2000  # readings, evenly spread, of which its pose is estimated: to save time
CONVENTION_ROWS = 240  # readings that compare hypotheses, spread over all runs: a prediction takes microseconds
ALIGNMENT_ROUNDS = 3  # of weights in a robust rigid motion: it is only a start
CONVENTION_WIDER = 5.0  # factor on the stated standard deviations: data sheets err by more than they say
CONVENTION_ANYWHERE = 1.0  # [m] standard deviation and bound of a position of which nothing is known
CONVENTION_ITERATIONS = 10  # of the fit of a hypothesis
CONVENTION_PATIENCE = 4  # of these iterations, after which a fit must be below the error that it is to beat
CONVENTION_DAMPING, CONVENTION_MOST_DAMPING = 1e-4, 1e6  # Levenberg-Marquardt: at first, and where the fit gives up
CONVENTION_SETTLED = 0.1  # [log posterior] that a step gains at least
CONVENTION_UNSOLVED = 1.0  # [m] error of a reading that the model cannot solve: as large as a robot
CONVENTION_FINEST = 1e-6  # [m] smallest error that counts, where the tracker states no jitter
CONVENTION_EVERY = 2  # of these readings, every second in a first look at each hypothesis
CONVENTION_ROUGH = 1.5  # error at this first look over that of the table as it is, above which none is looked at again
CONVENTION_LIKELY = 5  # hypotheses that are calibrated: those of least error in the file's frame, and in the best one
CONVENTION_SOLVED = 0.8  # fraction of readings that the model must solve
CONVENTION_AT_FLOOR = 2.0  # typical error over that of jitter, below which it is noise
CONVENTION_UNLIKELY = 10.0  # [log odds] prior against each of the many faults that are tried: most tables have none
CONVENTION_CLEAR = 0.5  # error that a clear finding leaves at most, over that of the table as it is
CONVENTION_ALIKE = 1.2  # errors of two hypotheses that explain the readings alike
CONVENTION_CONSTANT = 0.1  # of the error: what a wrong home or frame leaves at most; a physical effect leaves more
PHYSICS_LEAVES = 0.08  # typical error of a calibrated model over the deployed length that no effect exceeds: twice the
# largest of some 500 robots, simulated and real
CONVENTION_JUMP = 20.0  # stated sd that a home or a frame moves at least: data sheets err by less, and fits find that
CONVENTION_MOST_JUMP_DEG = 45.0  # ... but no more than this: a fit that starts so far off finds nothing
CONVENTION_OFFSET_STEP_DEG = 20  # of the home rotations that are tried: calibration finds what lies between
CONVENTION_SHIFTS_MM = (20, 40, 80)  # of home translations
CONVENTION_RUNS = 0.9  # quantile of the typical errors of the other runs, which a run homed elsewhere exceeds
# Offsets of a run that are looked for: [rad] all, [m] large ones, and the logarithm of the factor on a curvature.
CONVENTION_SCAN = {"alpha": 3.15, "beta": 0.05, "curvature": 0.7}
CONVENTION_SCAN_POINTS, CONVENTION_SCANS = 25, 3  # of a grid, and of grids, each within two points of the one before
MOST_CONVENTIONS = 4  # findings of a kind that are looked for, one after another
JOINT_SPEED, JOINT_SPEED_FACTOR = 0.2, 7.0  # [rad/s] usual speed of joints, and factor of one standard deviation
CONVENTION_ODDS = 3.0  # [log odds] from which another unit of time is clear
CONVENTION_RUN_ROWS, CONVENTION_MOST_RUNS = 20, 60  # readings of a run on which it is judged, and runs: to save time
