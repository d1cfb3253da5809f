# Functions for the CMakeLists.txt of the folders, each of which names only its sources and what it uses.

option(GLASSWING_WERROR "Treat warnings as errors" ON)
set(GLASSWING_TEST_PATIENCE 1 CACHE STRING "Factor by which the timeouts of tests are multiplied")
option(GLASSWING_GRPC_ORDER "Show the thread sanitizer gRPC's synchronisation (tests/sanitizers)" OFF)
option(GLASSWING_FUZZ "Also build tests/fuzz with libFuzzer (needs clang)" OFF)

# Every target is compiled with the same code-generation flags: they share the precompiled headers below, and
# the Python module is linked from the same libraries as the programs.
foreach(option -fPIC -fno-semantic-interposition -pthread)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:${option}>)
endforeach()

find_program(CCACHE ccache)
if(CCACHE)
  # ccache caches no file that uses a precompiled header unless this sloppiness is set. It hashes paths
  # relative to the checkout, so a second clone reuses what the first one compiled.
  set(launcher ${CMAKE_COMMAND} -E env
      CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime
      CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} ${CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${launcher})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${launcher})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fpch-preprocess>)
  endif()
endif()

# Enables our warnings for this target only, not for targets that link to it.
function(glasswing_warnings target)
  # g++ 12 wrongly reports absl::StatusOr's storage as uninitialized. It treats a .cpp that a unity build includes as a
  # header. Indices are signed (-Wconversion of g++ allows that, clang's does not).
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                         $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>
                         $<$<CXX_COMPILER_ID:Clang>:-Wno-sign-conversion>
                         $<$<AND:$<BOOL:${CMAKE_UNITY_BUILD}>,$<CXX_COMPILER_ID:GNU>>:-Wno-subobject-linkage>
                         $<$<BOOL:${GLASSWING_WERROR}>:-Werror>)
endfunction()

# For folders that spend more time waiting than computing, and those below: a release compiles them with -O1, which takes
# three quarters of the time of -O3. Call it before their targets.
macro(glasswing_compile_quickly)
  add_compile_options($<$<CONFIG:Release>:-O1>)
endmacro()

# Precompiled headers, shared by the whole build. Each target uses the smallest set that covers its includes:
# plain, rpc (adds gRPC and protobuf), test and rpc_test (add GoogleTest).
set(standard_headers <algorithm> <array> <chrono> <cmath> <cstdint> <filesystem> <functional> <map> <memory> <mutex>
    <numeric> <optional> <set> <span> <string> <string_view> <thread> <utility> <vector>
    <absl/status/statusor.h> <fmt/format.h>)
function(glasswing_precompiled kind)
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled/${kind}.cpp CONTENT "// Holds the precompiled headers \"${kind}\".\n")
  set(target glasswing_precompiled_${kind})
  add_library(${target} STATIC ${CMAKE_BINARY_DIR}/precompiled/${kind}.cpp)
  cmake_parse_arguments(ARG "" "" "HEADERS;USES" ${ARGN})
  target_link_libraries(${target} PRIVATE absl::statusor fmt::fmt ${ARG_USES})
  target_precompile_headers(${target} PRIVATE ${standard_headers} ${ARG_HEADERS})
  glasswing_warnings(${target})  # -Wpedantic changes predefined macros, which must equal those of the users
endfunction()
set(rpc_headers <grpcpp/grpcpp.h> <google/protobuf/map.h> <google/protobuf/repeated_field.h>)
glasswing_precompiled(plain)
glasswing_precompiled(rpc HEADERS ${rpc_headers} USES gRPC::grpc++ protobuf::libprotobuf)
if(GLASSWING_TESTS)
  glasswing_precompiled(test HEADERS <gtest/gtest.h> USES GTest::gtest)
  glasswing_precompiled(rpc_test HEADERS <gtest/gtest.h> ${rpc_headers} USES GTest::gtest gRPC::grpc++ protobuf::libprotobuf)
endif()

include(GlasswingLayers)

# Sets `result` to TRUE if a target of ARGN, or one that it uses, includes gRPC's headers.
function(glasswing_needs_rpc result)
  set(${result} FALSE PARENT_SCOPE)
  foreach(target ${ARGN})
    if(target STREQUAL proto.services OR target MATCHES "^gRPC::")
      set(${result} TRUE PARENT_SCOPE)
    elseif(TARGET ${target})
      get_target_property(inherited ${target} GLASSWING_RPC)
      if(inherited)
        set(${result} TRUE PARENT_SCOPE)
      endif()
    endif()
  endforeach()
endfunction()

# Gives `target` our warnings and the precompiled headers that suit what it uses (ARGN). `suffix` is _test for
# tests.
function(glasswing_set_up target suffix)
  glasswing_needs_rpc(rpc ${ARGN})
  set_target_properties(${target} PROPERTIES GLASSWING_RPC ${rpc})
  if(rpc)
    set(kind rpc${suffix})
  elseif(suffix)
    set(kind test)
  else()
    set(kind plain)
  endif()
  target_precompile_headers(${target} REUSE_FROM glasswing_precompiled_${kind})
  glasswing_warnings(${target})
endfunction()

# glasswing_library([NAME target] SOURCES a.cpp ... USES folder|library ... [PRIVATE library ...])
# The library of a folder. Without SOURCES it consists of headers only.
# NAME: the target's name, for a second library of a folder and for libraries of tests.
# PRIVATE: libraries that only sources include, no header.
function(glasswing_library)
  cmake_parse_arguments(ARG "" "NAME" "SOURCES;USES;PRIVATE" ${ARGN})
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  glasswing_targets(uses ${folder} ${ARG_USES})
  glasswing_note_layer(${folder} ${ARG_USES})
  set(name ${ARG_NAME})
  if(NOT name)
    string(REPLACE "/" "." name ${folder})
  endif()
  if(NOT ARG_SOURCES)
    add_library(${name} INTERFACE)
    target_include_directories(${name} INTERFACE ${PROJECT_SOURCE_DIR})
    target_link_libraries(${name} INTERFACE ${uses})
    return()
  endif()
  add_library(${name} ${ARG_SOURCES})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${uses} PRIVATE ${ARG_PRIVATE})
  glasswing_set_up(${name} "" ${uses})
  # A kernel includes itself once for each processor, and so needs its own translation unit.
  set(kernels ${ARG_SOURCES})
  list(FILTER kernels INCLUDE REGEX "_kernel\\.cpp$")
  set_source_files_properties(${kernels} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# glasswing_module(NAME SOURCES a.cpp ... USES library ... FOR target COMPONENT component)
# A shared module that the library `target` loads at its first use (core/process/module.h), for libraries that take long
# to load. It does not link our libraries.
function(glasswing_module name)
  cmake_parse_arguments(ARG "" "FOR;COMPONENT" "SOURCES;USES" ${ARGN})
  add_library(${name} MODULE ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES PREFIX "" LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/glasswing)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE absl::statusor ${ARG_USES})
  glasswing_warnings(${name})
  add_dependencies(${ARG_FOR} ${name})
  install(TARGETS ${name} DESTINATION lib/glasswing COMPONENT ${ARG_COMPONENT})
endfunction()

# glasswing_program(NAME SOURCES main.cpp USES folder|library ...)
function(glasswing_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES" ${ARGN})
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  glasswing_targets(uses ${folder} ${ARG_USES})
  glasswing_note_layer(${folder} ${ARG_USES})
  add_executable(${name} ${ARG_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${uses} ${GLASSWING_ORDER})
  glasswing_set_up(${name} "" ${uses})
endfunction()

# glasswing_man_pages(PROGRAM ARGUMENT COMPONENT)
# Installs the program and its manual pages, which `PROGRAM ARGUMENT DIR` writes after each build.
function(glasswing_man_pages program argument component)
  set(pages ${CMAKE_BINARY_DIR}/man/${program})
  add_custom_command(TARGET ${program} POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E env GLASSWING_CONFIG=/dev/null $<TARGET_FILE:${program}> ${argument} ${pages})
  install(TARGETS ${program} COMPONENT ${component})
  install(DIRECTORY ${pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component} FILES_MATCHING PATTERN "*.1")
  install(DIRECTORY ${pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man8 COMPONENT ${component} FILES_MATCHING PATTERN "*.8")
  add_dependencies(programs ${program})
endfunction()

# glasswing_completions(PROGRAM COMPONENT)
# Installs the scripts for shells, which the program itself prints.
function(glasswing_completions program component)
  set(completions ${CMAKE_BINARY_DIR}/completions)
  set(without_config ${CMAKE_COMMAND} -E env GLASSWING_CONFIG=/dev/null)
  add_custom_command(TARGET ${program} POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E make_directory ${completions}
    COMMAND ${without_config} $<TARGET_FILE:${program}> completion bash > ${completions}/${program}
    COMMAND ${without_config} $<TARGET_FILE:${program}> completion zsh > ${completions}/_${program}
    COMMAND ${without_config} $<TARGET_FILE:${program}> completion fish > ${completions}/${program}.fish)
  install(FILES ${completions}/${program} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT ${component})
  install(FILES ${completions}/_${program} DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT ${component})
  install(FILES ${completions}/${program}.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT ${component})
endfunction()

# glasswing_tests([PROGRAM name] TESTS a_test ... [SOURCES helper.cpp ...] USES folder|library ...
#                 [TIMEOUT SECONDS] [LABELS name ...] [ENVIRONMENT NAME=VALUE ...] [CASES name ...])
# Builds one test program for the folder. CTest runs each file of TESTS in a process of its own; the test's
# name is the file's path below tests/.
# PROGRAM: a separate program, which runs as a whole, for a test whose cases are in a header or in SOURCES.
# CASES: of a PROGRAM, one process for each: the cases whose names contain it; its TIMEOUT is each one's.
# LABELS: of glasswing_label_test(), default `unit`.
function(glasswing_tests)
  cmake_parse_arguments(ARG "" "PROGRAM;TIMEOUT" "TESTS;SOURCES;USES;LABELS;ENVIRONMENT;CASES" ${ARGN})
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR}/tests ${CMAKE_CURRENT_SOURCE_DIR})
  string(REPLACE "/" "." target "tests.${folder}")
  if(ARG_PROGRAM)
    list(LENGTH ARG_TESTS count)
    if(NOT count EQUAL 1)
      message(FATAL_ERROR "tests/${folder}: ${ARG_PROGRAM} runs as a whole, so it needs one test, not ${count}")
    endif()
    string(APPEND target ".${ARG_PROGRAM}")
  endif()
  glasswing_targets(uses tests/${folder} ${ARG_USES})
  list(TRANSFORM ARG_TESTS APPEND .cpp OUTPUT_VARIABLE sources)
  add_executable(${target} ${sources} ${ARG_SOURCES})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE ${uses} tests.main ${GLASSWING_ORDER})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  glasswing_set_up(${target} _test ${uses})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  math(EXPR timeout "${ARG_TIMEOUT} * ${GLASSWING_TEST_PATIENCE}")
  foreach(test ${ARG_TESTS} ${ARG_CASES})
    set(name ${folder}/${test})
    set(only)
    if(ARG_CASES)
      if(test IN_LIST ARG_TESTS)
        continue()
      endif()
      set(name ${folder}/${ARG_TESTS}/${test})
      set(only "--gtest_filter=*${test}*")
    elseif(NOT ARG_PROGRAM)
      set(only --file ${test}.cpp)
    endif()
    glasswing_test_priority(priority ${ARG_LABELS})
    # From where sources were compiled: ccache makes __FILE__ relative to it.
    add_test(NAME ${name} COMMAND ${priority} $<TARGET_FILE:${target}> ${only} WORKING_DIRECTORY ${CMAKE_BINARY_DIR})
    set_tests_properties(${name} PROPERTIES TIMEOUT ${timeout} ENVIRONMENT "${ARG_ENVIRONMENT}")
    glasswing_label_test(${name} ${ARG_LABELS})
  endforeach()
endfunction()

# glasswing_command_test(NAME COMMAND command ... [TIMEOUT SECONDS] [LABELS name ...] [ENVIRONMENT NAME=VALUE ...])
# A test that is a script. It finds the programs in GLASSWING_BIN, the build in GLASSWING_BUILD and the Python
# package on PYTHONPATH, and never reads the user's settings.
function(glasswing_command_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "COMMAND;LABELS;ENVIRONMENT" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  math(EXPR timeout "${ARG_TIMEOUT} * ${GLASSWING_TEST_PATIENCE}")
  set(environment "GLASSWING_BIN=${CMAKE_BINARY_DIR}/bin" "GLASSWING_BUILD=${CMAKE_BINARY_DIR}"
      "PYTHONPATH=${CMAKE_BINARY_DIR}/python" PYTHONDONTWRITEBYTECODE=1)
  if(NOT ARG_ENVIRONMENT)
    set(ARG_ENVIRONMENT GLASSWING_CONFIG=/dev/null)
  endif()
  glasswing_test_priority(priority ${ARG_LABELS})
  add_test(NAME ${name} COMMAND ${priority} ${ARG_COMMAND})
  set_tests_properties(${name} PROPERTIES TIMEOUT ${timeout} ENVIRONMENT "${environment};${ARG_ENVIRONMENT}")
  glasswing_label_test(${name} ${ARG_LABELS})
endfunction()

set(GLASSWING_PATIENT_TESTS "gate|rendered|fresh")

# glasswing_label_test(NAME [LABEL ...]): what kind of test it is, for `ctest -L` and tests/run.
#   unit    a program of a folder, or a script without daemons
#   rig     daemons in real time; one such test at a time
#   system  uses resources of the whole machine: root, containers, a cluster; runs alone
#   slow    over a minute; tests/run skips it unless given --all
#   gate, rendered, fresh  solve, or install and build, with what the rig test beside them leaves
# Others are for some command.
function(glasswing_label_test name)
  set(labels ${ARGN})
  if(NOT labels MATCHES "rig|system")
    list(APPEND labels unit)
  endif()
  set_tests_properties(${name} PROPERTIES LABELS "${labels}" SKIP_RETURN_CODE 77)
  if(labels MATCHES "system")
    set_tests_properties(${name} PROPERTIES RUN_SERIAL TRUE)
  elseif(labels MATCHES "rig")
    set_tests_properties(${name} PROPERTIES RESOURCE_LOCK rig COST 1000)
  elseif(labels MATCHES "${GLASSWING_PATIENT_TESTS}")
    set_tests_properties(${name} PROPERTIES RESOURCE_LOCK patient COST 100)
  endif()
endfunction()

# glasswing_test_priority(OUT [LABEL ...]): what a test's command begins with.
function(glasswing_test_priority out)
  set(priority)
  if(ARGN MATCHES "${GLASSWING_PATIENT_TESTS}")
    set(priority chrt --idle 0)  # frames of a rig come in time
  endif()
  set(${out} ${priority} PARENT_SCOPE)
endfunction()
