# The layers. A folder is a room: one library, whose target is the folder's path with dots ("server.rig"). USES
# names the folders that it may include, and libraries. A folder must be added after those that it uses, so there are no
# cycles, and programs never use each other's folders, except for the client, which includes the verbs of compositing.
# CheckLayers.cmake checks every include against USES.

# Turns the folders among the names that follow `folder` into targets; an error where the layers forbid one.
function(glasswing_targets result folder)
  set(targets)
  foreach(name ${ARGN})
    if(name MATCHES "/|^(server|console|client|compositing|solver|camera-node|display-node)$" AND NOT name MATCHES "::")
      string(REPLACE "/" "." target ${name})
      string(REGEX MATCH "^[^/]+" own ${folder})
      string(REGEX MATCH "^[^/]+" other ${name})
      if(NOT own STREQUAL other AND NOT own STREQUAL tests AND NOT other MATCHES "^(core|proto)$"
         AND NOT "${own} ${other}" STREQUAL "client compositing")
        message(FATAL_ERROR "${folder} uses ${name}; programs share only core and proto")
      endif()
      if(NOT TARGET ${target})
        message(FATAL_ERROR "${folder} uses ${name}, which is not below it: no such folder was added before")
      endif()
      list(APPEND targets ${target})
    else()
      list(APPEND targets ${name})
    endif()
  endforeach()
  set(${result} ${targets} PARENT_SCOPE)
endfunction()

# Records for CheckLayers.cmake the folders that `folder` may include.
function(glasswing_note_layer folder)
  if(folder MATCHES "^tests")
    return()
  endif()
  set_property(GLOBAL APPEND PROPERTY GLASSWING_ROOMS ${folder})
  set(folders ${ARGN})
  list(FILTER folders EXCLUDE REGEX "::")
  set_property(GLOBAL APPEND PROPERTY "GLASSWING_USES_${folder}" ${folders})
endfunction()

# Checks every include at every build (CheckLayers.cmake).
function(glasswing_check_layers)
  get_property(rooms GLOBAL PROPERTY GLASSWING_ROOMS)
  list(REMOVE_DUPLICATES rooms)
  set(layers)
  foreach(room ${rooms})
    get_property(uses GLOBAL PROPERTY "GLASSWING_USES_${room}")
    string(APPEND layers "list(APPEND rooms \"${room}\")\nset(\"uses_${room}\" ${uses})\n")
  endforeach()
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/layers.cmake CONTENT "${layers}" @ONLY)
  add_custom_target(layers ALL COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR}
                    -DLAYERS=${CMAKE_BINARY_DIR}/layers.cmake
                    -P ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/CheckLayers.cmake
                    COMMENT "Checking the layers" VERBATIM)
endfunction()
