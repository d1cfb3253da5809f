# Writes OUTPUT, a source that tells of what commit SOURCE_DIR is; leaves it alone where that has not changed.
execute_process(COMMAND git -C ${SOURCE_DIR} describe --always --exclude=* --abbrev=8 --dirty=+
                OUTPUT_VARIABLE id OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT
"#include \"core/service/build_id.h\"

const char* glasswing::build_id() {
  return \"@id@\";
}
")
