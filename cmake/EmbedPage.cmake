# Writes OUTPUT, a C++ source with the style sheet STYLE and the script of report pages: the library DYGRAPHS under its
# licence LICENCE, then SCRIPT. Where DYGRAPHS is empty there is no script.
#
# A page names the hashes of both in its content security policy, so both are constant and their hashes are taken here.
file(READ "${STYLE}" style)
set(script "")
set(name "")
if(DYGRAPHS)
  file(READ "${DYGRAPHS}" library)
  file(READ "${LICENCE}" licence)
  file(READ "${SCRIPT}" own)
  string(REGEX MATCH "dygraphs/blob/v([0-9.]+)/" found "${library}")
  set(name "dygraphs ${CMAKE_MATCH_1}")
  # The map of the minified source is no part of a page.
  string(REGEX REPLACE "\n//# sourceMappingURL=[^\n]*\n?$" "\n" library "${library}")
  string(REPLACE "*/" "* /" licence "${licence}")
  string(APPEND script "/* ${name}\n\n${licence}*/\n" "${library}" "${own}")
  string(TOLOWER "${script}" lower)
  foreach(ending "</script" "<!--" ")ringlock_page\"")
    string(FIND "${lower}" "${ending}" place)
    if(NOT place EQUAL -1)
      message(FATAL_ERROR "${DYGRAPHS}: holds ${ending}, which would end the script of a page")
    endif()
  endforeach()
endif()
string(SHA256 style_hash "${style}")
string(SHA256 script_hash "${script}")
set(source "// Made by cmake/EmbedPage.cmake.
#include \"analysis/report/page/assets.hpp\"

namespace ringlock::report::assets {

const std::string_view style = R\"ringlock_page(${style})ringlock_page\";
const std::string_view style_sha256 = \"${style_hash}\";
const std::string_view script = R\"ringlock_page(${script})ringlock_page\";
const std::string_view script_sha256 = \"${script_hash}\";
const std::string_view script_name = \"${name}\";

}  // namespace ringlock::report::assets
")
set(old "")
if(EXISTS "${OUTPUT}")
  file(READ "${OUTPUT}" old)
endif()
if(NOT old STREQUAL source)
  file(WRITE "${OUTPUT}" "${source}")
endif()
