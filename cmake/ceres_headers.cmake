# Ceres's headers: calibration uses its TinySolver and its automatic derivatives, and links nothing.
if(NOT TARGET ctcr::ceres_headers)
  find_path(CTCR_CERES_INCLUDE_DIR ceres/tiny_solver.h REQUIRED DOC "Folder of the headers of Ceres 2.1 or newer")
  add_library(ctcr::ceres_headers INTERFACE IMPORTED)
  target_include_directories(ctcr::ceres_headers INTERFACE ${CTCR_CERES_INCLUDE_DIR})
endif()
