# cpack reads this: the version of the packages. It increases with every commit, because labs also build
# between releases.
execute_process(COMMAND git -C ${CPACK_GLASSWING_SOURCE_DIR} log -1 --format=%cd.%h --date=format-local:%Y%m%d.%H%M%S
                        --abbrev=8 COMMAND_ERROR_IS_FATAL ANY OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE)
set(CPACK_DEBIAN_PACKAGE_VERSION ${CPACK_GLASSWING_VERSION}+${commit})
foreach(name ${CPACK_COMPONENTS_ALL})
  string(TOUPPER ${name} component)
  foreach(relation DEPENDS REPLACES BREAKS)
    string(REPLACE THIS_VERSION ${CPACK_DEBIAN_PACKAGE_VERSION} CPACK_DEBIAN_${component}_PACKAGE_${relation}
                   "${CPACK_DEBIAN_${component}_PACKAGE_${relation}}")
  endforeach()
endforeach()
