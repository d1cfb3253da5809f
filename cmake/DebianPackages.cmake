# glasswing_require_packages(LIST)
# Fails with the names of the Debian packages of deploy/packages/LIST.txt that this machine lacks. On other systems than
# Debian it checks nothing, and find_package() reports what it cannot find.
function(glasswing_require_packages list)
  execute_process(COMMAND ${PROJECT_SOURCE_DIR}/deploy/packages/missing ${list}
                  OUTPUT_VARIABLE missing OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  if(missing)
    string(REPLACE "\n" ", " missing ${missing})
    message(FATAL_ERROR "these Debian packages are not installed: ${missing}\n"
                        "To install what deploy/packages/${list}.txt lists: deploy/packages/install ${list}")
  endif()
endfunction()
