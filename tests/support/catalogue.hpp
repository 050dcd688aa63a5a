#pragma once
// Models with every effect of the catalogue, compiled once for all tests. Link ctcr_test_catalogue (catalogue.cmake).
#include "ctcr/effects/catalogue.hpp"
#include "ctcr/mechanics/shape.hpp"
#include "ctcr/recording/derivatives.hpp"

#define CTCR_TEST_CATALOGUE_SOLVER(kind, D, N)                                                                  \
  kind Status solve<Derivatives::D, MagnusRk4, N>(const Model<N, Catalogue>&, const Joints<N>&, const TipLoad&, \
                                                  Workspace<N>&, Solution<N>&, const Settings&) noexcept;       \
  kind Status step<Derivatives::D, MagnusRk4, N>(const Model<N, Catalogue>&, const Joints<N>&, const TipLoad&,  \
                                                 Workspace<N>&, Solution<N>&, const Settings&) noexcept;
#define CTCR_TEST_CATALOGUE(kind, N)                                                                               \
  CTCR_TEST_CATALOGUE_SOLVER(kind, none, N)                                                                        \
  CTCR_TEST_CATALOGUE_SOLVER(kind, compliance, N)                                                                  \
  kind Status predict<N, Catalogue>(const System<N, Catalogue>&, const RecordedRow<N>&,                            \
                                    const Catalogue::On<N>::History&, Workspace<N>&,                               \
                                    RecordedPrediction<N, Catalogue>&) noexcept;                                   \
  kind Status differentiate<N, Catalogue>(const System<N, Catalogue>&, const RecordedRow<N>&, const Workspace<N>&, \
                                          const RecordedPrediction<N, Catalogue>&, std::span<const int>,           \
                                          Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>>,                    \
                                          const RowHistorySensitivities&, Mat6*) noexcept;                         \
  kind std::vector<Catalogue::On<N>::History> histories<N, Catalogue>(                                             \
      const System<N, Catalogue>&, std::span<const RecordedRow<N>>, const RecordedPath<N>&);

namespace ctcr {
CTCR_TEST_CATALOGUE(extern template, 1)
CTCR_TEST_CATALOGUE(extern template, 2)
CTCR_TEST_CATALOGUE(extern template, 3)
}  // namespace ctcr
