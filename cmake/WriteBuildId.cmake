# Writes OUTPUT, a source file with the commit of SOURCE_DIR. Leaves the file untouched if its content would
# not change.
cmake_minimum_required(VERSION 3.25)
execute_process(COMMAND git -C ${SOURCE_DIR} describe --always --exclude=* --abbrev=8 --dirty=+
                OUTPUT_VARIABLE id OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT
"#include \"core/service/build_id.h\"

const char* glasswing::build_id() {
  return \"@id@\";
}
")
