# Run at every build: writes the git hash into a source file, which is touched only when it changes.
execute_process(COMMAND git -C "${SOURCE_DIR}" describe --always --dirty --abbrev=12 --exclude=*
                OUTPUT_VARIABLE hash OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT hash)
  set(hash "unknown")
endif()
execute_process(COMMAND git -C "${SOURCE_DIR}" log -1 --format=%cs
                OUTPUT_VARIABLE RINGLOCK_COMMIT_DATE OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
set(RINGLOCK_GIT_HASH "${hash}")
configure_file("${SOURCE_DIR}/engine/core/version.cpp.in" "${OUTPUT}" @ONLY)
