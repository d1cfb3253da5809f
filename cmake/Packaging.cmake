# Debian packages, made by CPack: one for each component of the install rules. deploy/package builds them all.
# The cache variable GLASSWING_PACKAGE_CONTACT is the maintainer named in the packages.

if(NOT GLASSWING_MODULES)
  return()  # There would be no package of Python's and none of the filter.
endif()
set(GLASSWING_PACKAGE_CONTACT "Glasswing <glasswing@example.org>" CACHE STRING "maintainer of Debian packages")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME glasswing)
set(CPACK_PACKAGE_CONTACT ${GLASSWING_PACKAGE_CONTACT})
set(CPACK_COMPONENTS_ALL common pictures server console display camera solver compositing client frei0r python demo)
set(CPACK_DEB_COMPONENT_INSTALL ON)
# DESTDIR, because the configuration is installed outside the prefix.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
    WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_PROJECT_CONFIG_FILE ${PROJECT_SOURCE_DIR}/cmake/PackageVersion.cmake)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/FinishPackages.cmake)
set(CPACK_GLASSWING_SOURCE_DIR ${PROJECT_SOURCE_DIR})
set(CPACK_GLASSWING_VERSION ${PROJECT_VERSION})

# glasswing_package(COMPONENT NAME package [ALL] SUMMARY line TEXT paragraph DEPENDS list RECOMMENDS list
#                   [UNIT unit] [SCRIPTS directory])
# SCRIPTS: directory below deploy/debian with maintainer scripts, in which @unit@ becomes UNIT.
macro(glasswing_package component)
  cmake_parse_arguments(ARG "ALL" "NAME;SUMMARY;TEXT;DEPENDS;RECOMMENDS;UNIT;SCRIPTS" "" ${ARGN})
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${ARG_NAME})
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${ARG_SUMMARY}\n${ARG_TEXT}")
  set(CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS "${ARG_DEPENDS}")
  set(CPACK_DEBIAN_${upper}_PACKAGE_RECOMMENDS "${ARG_RECOMMENDS}")
  if(ARG_ALL)
    set(CPACK_DEBIAN_${upper}_PACKAGE_ARCHITECTURE all)
    set(CPACK_DEBIAN_${upper}_PACKAGE_SHLIBDEPS OFF)
  endif()
  set(scripts ${PROJECT_BINARY_DIR}/debian/${component})
  set(unit ${ARG_UNIT})
  foreach(script preinst postinst prerm postrm conffiles)
    set(from ${PROJECT_SOURCE_DIR}/deploy/debian/${ARG_SCRIPTS}/${script})
    if(ARG_SCRIPTS AND EXISTS ${from})
      configure_file(${from} ${scripts}/${script} @ONLY)
      list(APPEND CPACK_DEBIAN_${upper}_PACKAGE_CONTROL_EXTRA ${scripts}/${script})
    endif()
  endforeach()
endmacro()

set(about "Glasswing captures environment mattes: for every camera pixel, how light\nfrom the monitors around an object reaches that pixel.")
glasswing_package(common NAME glasswing-common ALL SCRIPTS common
  SUMMARY "capture of environment mattes - configuration of the daemons"
  TEXT "${about}\n.\nThis package contains what the daemons on a machine share: configuration, the\nuser that they run as, and alerts and a dashboard for Prometheus and Grafana."
  DEPENDS "systemd | systemd-sysusers")
glasswing_package(pictures NAME glasswing-pictures
  SUMMARY "capture of environment mattes - picture files"
  TEXT "${about}\n.\nThis package contains the module with which the programs read and write PNG,\nJPEG and TIFF files. They load it with the first picture."
)
set(shared "glasswing-common (= THIS_VERSION), glasswing-pictures (= THIS_VERSION)")
glasswing_package(server NAME glasswing-server SCRIPTS daemon UNIT glasswing-server
  SUMMARY "capture of environment mattes - server"
  TEXT "${about}\n.\nThis package contains the server, which runs sessions, proves which frame\nshows which pattern, hands work to solvers, and keeps finished mattes."
  DEPENDS "${shared}" RECOMMENDS "glasswing-client, glasswing-compositing, glasswing-console")
glasswing_package(console NAME glasswing-console SCRIPTS daemon UNIT glasswing-console
  SUMMARY "capture of environment mattes - console for browsers"
  TEXT "${about}\n.\nThis package contains the console, which shows a rig in browsers, with its\npage. It is a client of the server and runs as a user of its own."
  DEPENDS "${shared}")
# The page was part of the server's package.
set(CPACK_DEBIAN_CONSOLE_PACKAGE_REPLACES "glasswing-server (<< THIS_VERSION)")
set(CPACK_DEBIAN_CONSOLE_PACKAGE_BREAKS "glasswing-server (<< THIS_VERSION)")
glasswing_package(display NAME glasswing-display SCRIPTS daemon UNIT glasswing-display
  SUMMARY "capture of environment mattes - display node"
  TEXT "${about}\n.\nThis package contains the display node, which shows patterns on the monitors\nof its machine and reports when each was visible."
  DEPENDS "${shared}")
glasswing_package(camera NAME glasswing-camera SCRIPTS daemon UNIT glasswing-camera
  SUMMARY "capture of environment mattes - camera node"
  TEXT "${about}\n.\nThis package contains the camera node, which records frames and reports when\neach was exposed."
  DEPENDS "${shared}, libcamera-ipa")
glasswing_package(solver NAME glasswing-solver SCRIPTS daemon UNIT glasswing-solver
  SUMMARY "capture of environment mattes - solver"
  TEXT "${about}\n.\nThis package contains the solver, which turns frames into a matte together\nwith the other solvers of the lab."
  DEPENDS "${shared}")
glasswing_package(compositing NAME glasswing-compositing
  SUMMARY "capture of environment mattes - composites, edits and deliveries of mattes"
  TEXT "${about}\n.\nThis package contains the program glasswing-compositing, which composites, edits,\nshows and delivers mattes without a rig, the player of folders for the web, and\nthe add-on for Blender."
  DEPENDS "glasswing-pictures (= THIS_VERSION)" RECOMMENDS "bash-completion")
# They were part of the client's package.
set(CPACK_DEBIAN_COMPOSITING_PACKAGE_REPLACES "glasswing-client (<< THIS_VERSION)")
set(CPACK_DEBIAN_COMPOSITING_PACKAGE_BREAKS "glasswing-client (<< THIS_VERSION)")
glasswing_package(client NAME glasswing-client
  SUMMARY "capture of environment mattes - command line"
  TEXT "${about}\n.\nThis package contains the program glasswing, which captures, solves, fetches\nand composites, with its manual pages, shell completion and example plans."
  DEPENDS "glasswing-compositing (= THIS_VERSION)" RECOMMENDS "bash-completion")
glasswing_package(frei0r NAME glasswing-frei0r
  SUMMARY "capture of environment mattes - filter for video editors"
  TEXT "${about}\n.\nThis package contains a filter that puts captured objects into the frames of\nKdenlive, ffmpeg, MLT and other hosts of frei0r.")
get_directory_property(python DIRECTORY client/python DEFINITION Python_VERSION_MAJOR)
get_directory_property(minor DIRECTORY client/python DEFINITION Python_VERSION_MINOR)
math(EXPR next "${minor} + 1")
glasswing_package(python NAME python3-glasswing SCRIPTS python
  SUMMARY "capture of environment mattes - Python package"
  TEXT "${about}\n.\nThis package contains the Python module glasswing, with mattes as numpy\narrays."
  DEPENDS "glasswing-pictures (= THIS_VERSION), python3 (>= ${python}.${minor}), python3 (<< ${python}.${next}), python3-grpcio, python3-numpy, python3-protobuf")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(programs server console display camera solver client)
list(TRANSFORM programs REPLACE "(.+)" "glasswing-\\1 (= THIS_VERSION)")
list(JOIN programs ", " programs)
glasswing_package(demo NAME glasswing-demo ALL
  SUMMARY "capture of environment mattes - demonstration"
  TEXT "${about}\n.\nThis package contains glasswing-demo, which captures a crystal with simulated\ndevices and puts it in front of pictures, and glasswing-local-rig, which runs\nsuch a rig."
  DEPENDS "${programs}")

include(CPack)
