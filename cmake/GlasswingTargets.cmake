# Helpers that keep every target's CMakeLists.txt to its sources and its layer.

option(GLASSWING_WERROR "Treat warnings as errors" ON)
set(GLASSWING_TEST_PATIENCE 1 CACHE STRING "How many times as long as usual tests may take")
option(GLASSWING_GRPC_ORDER "Tell the thread sanitizer of gRPC's order (tests/sanitizers)" OFF)
option(GLASSWING_FUZZ "Build tests/fuzz with libFuzzer too (needs clang)" OFF)

# Warnings are ours alone: they never reach a target's users.
function(glasswing_warnings target)
  # g++ 12 takes absl::StatusOr's storage for uninitialized.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                         $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>
                         $<$<BOOL:${GLASSWING_WERROR}>:-Werror>)
endfunction()

# glasswing_library(NAME SOURCES a.cpp ... USES lib ...)
function(glasswing_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${ARG_USES})
  glasswing_warnings(${name})
endfunction()

# glasswing_program(NAME SOURCES main.cpp USES lib ...)
function(glasswing_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_USES} ${GLASSWING_ORDER})
  glasswing_warnings(${name})
endfunction()

# glasswing_man_pages(PROGRAM ARGUMENT COMPONENT): the program writes its pages itself when `ARGUMENT DIR` says so;
# installs both.
function(glasswing_man_pages program argument component)
  set(pages ${CMAKE_BINARY_DIR}/man/${program})
  add_custom_command(TARGET ${program} POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E env GLASSWING_CONFIG=/dev/null $<TARGET_FILE:${program}> ${argument} ${pages})
  install(TARGETS ${program} COMPONENT ${component})
  install(DIRECTORY ${pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component} FILES_MATCHING PATTERN "*.1")
  install(DIRECTORY ${pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man8 COMPONENT ${component} FILES_MATCHING PATTERN "*.8")
endfunction()

# glasswing_test(NAME_test USES lib ...): builds NAME_test.cpp; the CTest name is its path below tests/.
# One CTest entry a file keeps the run short.
function(glasswing_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "USES;ENVIRONMENT" ${ARGN})
  file(RELATIVE_PATH path ${PROJECT_SOURCE_DIR}/tests ${CMAKE_CURRENT_SOURCE_DIR}/${name})
  string(REPLACE "/" "." target ${path})
  add_executable(${target} ${name}.cpp)
  target_link_libraries(${target} PRIVATE ${ARG_USES} GTest::gtest GTest::gtest_main ${GLASSWING_ORDER})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  glasswing_warnings(${target})
  add_test(NAME ${path} COMMAND ${target})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  math(EXPR ARG_TIMEOUT "${ARG_TIMEOUT} * ${GLASSWING_TEST_PATIENCE}")
  set_tests_properties(${path} PROPERTIES TIMEOUT ${ARG_TIMEOUT} ENVIRONMENT "${ARG_ENVIRONMENT}")
endfunction()

# gRPC's headers take seconds to parse; the targets that see them share the parse within a target.
function(glasswing_precompile_grpc target)
  target_precompile_headers(${target} PRIVATE <grpcpp/grpcpp.h>)
endfunction()
