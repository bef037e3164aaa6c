# Writes OUTPUT, a C++ source with the texts of all FOLDER/*.toml, by name. The program finds the gyros that it knows
# wherever it is installed.
file(GLOB files "${FOLDER}/*.toml")
list(SORT files)
set(entries "")
foreach(file IN LISTS files)
  get_filename_component(name "${file}" NAME_WE)
  file(READ "${file}" text)
  string(APPEND entries "    DeviceFile{\"${name}\", R\"toml(${text})toml\"},\n")
endforeach()
set(source "// Made from scenarios/devices by cmake/EmbedDevices.cmake.
#include <array>

#include \"engine/scenario/devices.hpp\"

namespace ringlock::scenario {

std::span<const DeviceFile> device_files() {
  static constexpr std::array files = {
${entries}  };
  return files;
}

}  // namespace ringlock::scenario
")
set(old "")
if(EXISTS "${OUTPUT}")
  file(READ "${OUTPUT}" old)
endif()
if(NOT old STREQUAL source)
  file(WRITE "${OUTPUT}" "${source}")
endif()
