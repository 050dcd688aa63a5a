# Installs the headers and the package that find_package(ctcr) looks for; calibration is a component of its own.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(package_dir ${CMAKE_INSTALL_DATADIR}/cmake/ctcr)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/ctcr-config-version.cmake
                                 COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
install(TARGETS ctcr ctcr_native EXPORT ctcr-targets FILE_SET HEADERS)
install(EXPORT ctcr-targets NAMESPACE ctcr:: DESTINATION ${package_dir})
install(FILES ${PROJECT_BINARY_DIR}/ctcr-config-version.cmake cmake/ctcr-config.cmake DESTINATION ${package_dir})
if(CTCR_CALIBRATION)
  install(TARGETS ctcr_calibration EXPORT ctcr-calibration-targets FILE_SET HEADERS)
  install(EXPORT ctcr-calibration-targets NAMESPACE ctcr:: DESTINATION ${package_dir})
  install(FILES cmake/ceres_headers.cmake DESTINATION ${package_dir})
endif()
