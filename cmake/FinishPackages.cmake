# cpack runs this after installing and before packing. Adds what Debian requires in a package beyond our install rules.
execute_process(COMMAND git -C ${CPACK_GLASSWING_SOURCE_DIR} log -1 --format=%cD COMMAND_ERROR_IS_FATAL ANY
                OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE)
foreach(component ${CPACK_COMPONENTS_ALL})
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(usr ${CPACK_TEMPORARY_DIRECTORY}/${component}/usr)
  set(doc ${usr}/share/doc/${package})
  file(COPY ${CPACK_GLASSWING_SOURCE_DIR}/deploy/debian/copyright DESTINATION ${doc}
       FILE_PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
  file(WRITE ${doc}/changelog
       "${package} (${CPACK_DEBIAN_PACKAGE_VERSION}) bookworm; urgency=medium\n\n"
       "  * Built from its repository, whose CHANGELOG.md lists the changes.\n\n"
       " -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
  file(GLOB pages ${usr}/share/man/man?/*)
  execute_process(COMMAND gzip -9n ${doc}/changelog ${pages} COMMAND_ERROR_IS_FATAL ANY)
  # Debian's Python versions share one directory.
  file(GLOB python ${usr}/lib/python3.*)
  if(python)
    file(RENAME ${python} ${usr}/lib/python3)
    file(GLOB module ${usr}/lib/python3/dist-packages/glasswing/*.so)
    execute_process(COMMAND strip --strip-unneeded --remove-section=.comment ${module} COMMAND_ERROR_IS_FATAL ANY)
  endif()
endforeach()
