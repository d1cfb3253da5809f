# The targets opencv_NAME of the modules that we use. Debian's libopencv-dev, which has OpenCV's own CMake files,
# would install VTK, Qt and a hundred packages more; a module's own package does not.
find_path(OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)

# glasswing_find_opencv(MODULE...)
function(glasswing_find_opencv)
  foreach(module ${ARGN})
    find_library(OPENCV_${module} opencv_${module} REQUIRED)
    add_library(opencv_${module} SHARED IMPORTED GLOBAL)
    set_target_properties(opencv_${module} PROPERTIES IMPORTED_LOCATION ${OPENCV_${module}}
                          INTERFACE_INCLUDE_DIRECTORIES ${OPENCV_INCLUDE_DIR})
    if(NOT module STREQUAL core)
      target_link_libraries(opencv_${module} INTERFACE opencv_core)
    endif()
  endforeach()
endfunction()
glasswing_find_opencv(core imgproc imgcodecs videoio calib3d aruco)
