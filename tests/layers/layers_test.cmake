# No include of the tree runs against the layers, and the checks catch what they should: a forbidden include, a
# folder used before it was added, and one program's folder used by another.
# -DROOT=DIR of the sources, -DLAYERS=FILE as configured, -DWORK=DIR to write fixtures to.
cmake_minimum_required(VERSION 3.25)

# Runs a command, which must `outcome` (PASS or FAIL) and print something that matches `pattern`.
function(expect outcome pattern)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE printed ERROR_VARIABLE printed)
  string(REGEX REPLACE "[ \n]+" " " line "${printed}")  # messages are wrapped
  if(result EQUAL 0)
    set(came PASS)
  else()
    set(came FAIL)
  endif()
  if(NOT came STREQUAL outcome OR NOT line MATCHES "${pattern}")
    message(SEND_ERROR "expected ${outcome} and \"${pattern}\" of: ${ARGN}\n${came}: ${printed}")
  else()
    message(STATUS "${outcome}, as expected: ${CMAKE_MATCH_0}")
  endif()
endfunction()

function(check_layers outcome pattern root layers)
  expect(${outcome} "${pattern}"
         ${CMAKE_COMMAND} -DROOT=${root} -DLAYERS=${layers} -P ${ROOT}/cmake/CheckLayers.cmake)
endfunction()

# Configures a project whose folders are `ARGN`, one "FOLDER USES..." each.
function(configure outcome pattern)
  set(project ${WORK}/project)
  file(REMOVE_RECURSE ${project})
  set(text "cmake_minimum_required(VERSION 3.25)
project(fixture LANGUAGES NONE)
include(${ROOT}/cmake/GlasswingLayers.cmake)
function(folder name)
  glasswing_targets(uses \${name} \${ARGN})
  glasswing_note_layer(\${name} \${ARGN})
  string(REPLACE / . target \${name})
  add_library(\${target} INTERFACE)
  target_link_libraries(\${target} INTERFACE \${uses})
endfunction()
")
  foreach(folder ${ARGN})
    string(APPEND text "folder(${folder})\n")
  endforeach()
  string(APPEND text "glasswing_check_layers()\n")
  file(WRITE ${project}/CMakeLists.txt "${text}")
  expect(${outcome} "${pattern}" ${CMAKE_COMMAND} -S ${project} -B ${project}/build)
endfunction()

# The tree itself.
check_layers(PASS "[0-9]+ folders, 0 includes against the layers" ${ROOT} ${LAYERS})

# A tree in which core/base includes core/frame, which is above it.
set(tree ${WORK}/tree)
file(REMOVE_RECURSE ${tree})
file(WRITE ${tree}/layers.cmake [[
list(APPEND rooms "core/base" "core/frame")
set("uses_core/base")
set("uses_core/frame" core/base)
]])
file(WRITE ${tree}/core/frame/image.h "#include \"core/base/time.h\"\n")
file(WRITE ${tree}/core/base/time.h "#include <chrono>\n")
check_layers(PASS "2 folders, 0 includes against the layers" ${tree} ${tree}/layers.cmake)
file(WRITE ${tree}/core/base/time.h "#include \"core/frame/image.h\"\n")
check_layers(FAIL "core/base/time.h: .*core/base may not include core/frame" ${tree} ${tree}/layers.cmake)

configure(PASS "Generating done" "core/base" "core/frame core/base" "server/rig core/frame")
check_layers(PASS "3 folders, 0 includes against the layers" ${tree}/none ${WORK}/project/build/layers.cmake)
configure(FAIL "core/frame uses core/base, which is not below it" "core/frame core/base" "core/base")
configure(FAIL "solver/live uses server/rig; programs share only core and proto"
          "server/rig" "solver/live server/rig")
