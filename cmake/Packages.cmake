# Debian packages: `cpack` in a build folder, or `tools/package`, which also makes them reproducible and checks them.
# ringlock            the program, manual pages, completions
# libringlock-dev     headers, library, CMake package, where the build installs the component `library`
# python3-ringlock    the module, where RINGLOCK_PYTHON is on (component `python`)
# ringlock-doc        the pages of docs/, and scenarios as examples
# Install rules that name no component belong to the program.
include(GNUInstallDirs)

# The pages link to each other and to the scenarios; they keep their places under one folder.
set(pages "${CMAKE_INSTALL_DATAROOTDIR}/doc/ringlock-doc")
install(FILES "${PROJECT_SOURCE_DIR}/README.md" DESTINATION "${pages}" COMPONENT documentation)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs" DESTINATION "${pages}" COMPONENT documentation)
install(FILES "${PROJECT_SOURCE_DIR}/results/FORMAT.md" DESTINATION "${pages}/results" COMPONENT documentation)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/scenarios/" DESTINATION "${pages}/examples" COMPONENT documentation)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME ringlock)
set(CPACK_PACKAGE_VENDOR "The ringlock authors")
set(CPACK_PACKAGE_VERSION "${PROJECT_VERSION}")
# cpack puts the summary of the project above those of the packages, unless it is this one.
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_NAME} built using CMake")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 0ringlock1)  # less than the 1 of a package of Debian itself
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)

# Maintainer and date are those of the last commit, so that one commit gives one package. A tree without git names its
# maintainer itself.
set(RINGLOCK_PACKAGE_MAINTAINER "" CACHE STRING
  "Maintainer of packages, NAME <ADDRESS>; empty: the project, with the address of the last commit")
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${RINGLOCK_PACKAGE_MAINTAINER}")
execute_process(COMMAND git -C "${PROJECT_SOURCE_DIR}" log -1 --format=%ae%n%at OUTPUT_VARIABLE commit
  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
string(REPLACE "\n" ";" commit "${commit}")
list(LENGTH commit commit_lines)
set(package_seconds 0)
if(commit_lines EQUAL 2)
  list(GET commit 0 address)
  list(GET commit 1 package_seconds)
  if(NOT CPACK_DEBIAN_PACKAGE_MAINTAINER)
    set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${CPACK_PACKAGE_VENDOR} <${address}>")
  endif()
endif()
if(DEFINED ENV{SOURCE_DATE_EPOCH})
  set(package_seconds "$ENV{SOURCE_DATE_EPOCH}")
endif()

# What the packages have that an installation by `cmake --install` has not: copyright, changelog, packed manual pages,
# and the one date of all files.
configure_file("${PROJECT_SOURCE_DIR}/cmake/PackageFiles.cmake.in" "${PROJECT_BINARY_DIR}/PackageFiles.cmake" @ONLY)
set(CPACK_PRE_BUILD_SCRIPTS "${PROJECT_BINARY_DIR}/PackageFiles.cmake")

# ringlock_package(COMPONENT NAME SECTION "SUMMARY" "DESCRIPTION")
macro(ringlock_package component name section summary description)
  string(TOUPPER "${component}" upper)
  list(APPEND CPACK_COMPONENTS_ALL ${component})
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section})
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${summary}\n${description}")
endmacro()

set(CPACK_COMPONENTS_ALL "")
ringlock_package(program ringlock science "simulation of lock-in in mechanically dithered ring laser gyros"
"ringlock simulates ensembles of mechanically dithered ring laser gyros and
compares cures of their lock-in error: injected noise and compensation. It
estimates Allan deviations and noise coefficients, of its own results and of
measured logs, and finds error sources in measured records.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS gnuplot-nox)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS ringlock-doc)

if(TARGET ringlock_library)
  ringlock_package(library libringlock-dev libdevel "ringlock as a library for C++"
"Headers, static library, CMake package and pkg-config file of ringlock, which
simulates mechanically dithered ring laser gyros, estimates Allan deviations
and finds error sources in measured records.")
  # A static library needs what it is made with: the libraries of the list, down to the tests.
  file(STRINGS "${PROJECT_SOURCE_DIR}/tools/packages-debian.txt" lines)
  set(within OFF)
  set(needed "")
  foreach(line IN LISTS lines)
    if(line MATCHES "^# ")
      set(within OFF)
      if(line MATCHES "^# Libraries")
        set(within ON)
      endif()
    elseif(within AND line MATCHES "^([a-z0-9.+-]+)")
      list(APPEND needed "${CMAKE_MATCH_1}")
    endif()
  endforeach()
  list(JOIN needed ", " needed)
  set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS "${needed}")
endif()

if(RINGLOCK_PYTHON)
  ringlock_package(python python3-ringlock python "ringlock as a module for Python"
"The module ringlock runs studies of mechanically dithered ring laser gyros,
estimates Allan deviations of NumPy arrays, closes the loop with measured
records and reads results.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11~), python3 (<< 3.12), python3-numpy")
  # Modules are compiled at installation, and what Python makes of them goes with the package.
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA
    "${PROJECT_SOURCE_DIR}/cmake/python-package/postinst;${PROJECT_SOURCE_DIR}/cmake/python-package/prerm")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_STRICT_PERMISSION ON)
endif()

ringlock_package(documentation ringlock-doc doc "documentation of ringlock, and scenarios as examples"
"The pages of ringlock: physics, scenarios, results, records, commands, studies
and tutorials, with the scenarios of the studies as examples.")
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_ARCHITECTURE all)

include(CPack)
