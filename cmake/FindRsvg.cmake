# Pictures in PNG and PDF: librsvg draws the SVG, cairo writes the file. Debian's librsvg2-dev has both, with pkg-config.
find_package(PkgConfig QUIET)
if(PkgConfig_FOUND)
  pkg_check_modules(Rsvg QUIET librsvg-2.0>=2.52 cairo)
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Rsvg REQUIRED_VARS Rsvg_INCLUDE_DIRS
  REASON_FAILURE_MESSAGE "figures will be SVG only. For PNG and PDF install librsvg2-dev, as tools/setup does")
