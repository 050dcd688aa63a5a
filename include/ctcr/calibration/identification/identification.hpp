#pragma once
// Options and result of a joint fit.
#include <functional>
#include <optional>

#include "ctcr/calibration/identification/bounds.hpp"
#include "ctcr/calibration/identification/whitening.hpp"

namespace ctcr {
/// Residuals (6 rows) at parameters x: measured - predicted position [m] and rotation vector [rad] of each row,
/// interleaved, NaN where not measured (in the same rows for every x); and, unless null, their derivatives
/// (6 rows, parameters). Both are resized. Returns false where the prediction fails at x: the step is then shortened.
using Predictor = std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian)>;

struct IdentifyOptions {
  bool robust = true;  ///< outliers count for little; else every reading counts
  /// Adds jitter where the residuals exceed the noise: else the fit would trade millimetres that look like a field error
  /// for micrometres that do not. Off: the noise is taken as stated.
  bool admit_model_error = true;
  std::optional<RowWeights> weights = {};            ///< frozen; a weight of 0 leaves a position or a rotation out
  std::optional<Eigen::Array2d> inflation = {};      ///< frozen, see Identification
  std::optional<Eigen::MatrixXd> correlations = {};  ///< of the priors; independent otherwise
  std::optional<Eigen::VectorXd> start = {};         ///< where to start; the prior means otherwise
  std::optional<RowWeights> first_weights = {};      ///< of a fit near the start, to begin with; all count otherwise
  int starts = 3;                                    ///< the first and others drawn from the prior, compared at the end
  int max_iterations = 50;                           ///< of each descent
  double tolerance = 0.02;                 ///< of minus the log posterior: where less is to gain, a descent may end
  std::vector<LinearBound> within = {};    ///< bounds of sums of parameters, in addition to those of each
  std::vector<KnownDirection> known = {};  ///< directions that are described in words where they are undetermined
  double strong_correlation = 0.9;         ///< correlations beyond it are listed
};

/// Where one of several starts led.
struct Start {
  double cost;      ///< -log posterior density there, up to the constant that all starts share
  double distance;  ///< to the result, in posterior sd (root of the Mahalanobis square)
  bool converged;
};

struct Identification {
  bool converged = false;
  std::string status;                 ///< in words
  std::vector<std::string> warnings;  ///< whole sentences
  Eigen::VectorXd values, sd;         ///< in the parameters' units; sd infinite: not determined
  Eigen::VectorXd shift;              ///< (value - mean) / prior sd; NaN without a prior
  Eigen::VectorXd ratio;              ///< posterior / prior sd; NaN without a prior
  Eigen::MatrixXd covariance;         ///< in the parameters' units
  std::vector<Correlation> correlations;
  std::vector<Direction> directions;  ///< undetermined ones

  double chi_square = 0;            ///< of the residuals under the noise as stated, outliers counting for little
  double admitted_chi_square = 0;   ///< the same under the noise with the inflation of the fit
  double shift_square = 0;          ///< sum of the squared shifts, of correlated priors in their metric
  Eigen::Index observations = 0;    ///< numbers fitted
  double bulk_observations = 0;     ///< without the outliers: degrees of freedom of chi_square + shift_square
  double effective_parameters = 0;  ///< trace of the hat matrix: how many the readings determine rather than the prior
  double reduced_chi_square = 0;    ///< chi_square / (bulk_observations - effective_parameters)
  /// Laplace approximation, under the weights and the inflation of this fit: compare models at frozen ones. NaN where a
  /// prior is infinite.
  double log_evidence = 0;
  /// Factor on the sd of the jitter of positions and of rotations that the fit had to admit; 1: the noise explains all.
  Eigen::Array2d inflation = Eigen::Array2d::Ones();

  RowWeights weights;
  Whitening whitening;  ///< of the fit, inflation included
  std::vector<Start> starts;
  int iterations = 0, evaluations = 0;
};

}  // namespace ctcr
