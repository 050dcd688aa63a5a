# The calibration headers, the only ones that need Ceres: ctcr::calibration.
include(cmake/ceres_headers.cmake)

add_library(ctcr_calibration INTERFACE)
add_library(ctcr::calibration ALIAS ctcr_calibration)
target_sources(ctcr_calibration INTERFACE FILE_SET HEADERS BASE_DIRS include FILES ${calibration_headers})
target_link_libraries(ctcr_calibration INTERFACE ctcr::ctcr ctcr::ceres_headers)
set_target_properties(ctcr_calibration PROPERTIES EXPORT_NAME calibration
                                                  VERIFY_INTERFACE_HEADER_SETS ${PROJECT_IS_TOP_LEVEL})
