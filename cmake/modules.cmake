# interneuron_headers(): the public headers, std only.
# interneuron_module(NAME SOURCES ... [USES module ...] [LIBRARIES external ...]): one folder, one target. Modules are
# object libraries, so that the installed library is their union; USES carries both include paths and objects.
# interneuron_test(MODULE SOURCES ... [USES ...]): the tests of one folder, one executable.
# interneuron_vm_test(NAME [FULL] TIMEOUT seconds COMMAND ...): a test that boots a machine of scripts/vm.sh. FULL: takes
# minutes, so only `ctest -C full` runs it (scripts/test.sh --full).

set(INTERNEURON_WARNINGS -Wall -Wextra -Wconversion -Wshadow -Wpedantic -Werror)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # g++ 12 sees uninitialised members in moved std::variants (GCC bug 105562) and overlaps in string concatenations (GCC
  # bug 105651) that are not there; clang and the sanitizers look instead.
  list(APPEND INTERNEURON_WARNINGS -Wno-maybe-uninitialized -Wno-restrict)
endif()

function(interneuron_headers)
  add_library(interneuron_include INTERFACE)
  target_include_directories(interneuron_include INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  add_custom_target(interneuron_layers ALL
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/scripts/check_layers.py
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} VERBATIM)
endfunction()

function(interneuron_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LIBRARIES" ${ARGN})
  set(target interneuron_${name})
  add_library(${target} OBJECT ${ARG_SOURCES})
  target_compile_options(${target} PRIVATE ${INTERNEURON_WARNINGS})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR})
  # Headers of a module may include those of the libraries that it uses.
  interneuron_closure(used ${ARG_USES})
  set(libraries ${ARG_LIBRARIES})
  foreach(module IN LISTS used)
    get_property(more TARGET interneuron_${module} PROPERTY INTERNEURON_LIBRARIES)
    list(APPEND libraries ${more})
  endforeach()
  target_link_libraries(${target} PRIVATE interneuron_include ${libraries})
  add_dependencies(${target} interneuron_layers)
  set_property(TARGET ${target} PROPERTY INTERNEURON_USES ${ARG_USES})
  set_property(TARGET ${target} PROPERTY INTERNEURON_LIBRARIES ${ARG_LIBRARIES})
endfunction()

# Everything a set of modules needs, transitively.
function(interneuron_closure out)
  set(todo ${ARGN})
  set(done)
  while(todo)
    list(POP_FRONT todo module)
    if(module IN_LIST done)
      continue()
    endif()
    list(APPEND done ${module})
    get_property(uses TARGET interneuron_${module} PROPERTY INTERNEURON_USES)
    list(APPEND todo ${uses})
  endwhile()
  set(${out} ${done} PARENT_SCOPE)
endfunction()

# Links modules, with all that they use, into an executable or library.
function(interneuron_link target)
  interneuron_closure(modules ${ARGN})
  foreach(module IN LISTS modules)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:interneuron_${module}>)
    get_property(libraries TARGET interneuron_${module} PROPERTY INTERNEURON_LIBRARIES)
    target_link_libraries(${target} PRIVATE ${libraries})
  endforeach()
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE interneuron_include)
  target_compile_options(${target} PRIVATE ${INTERNEURON_WARNINGS})
endfunction()

function(interneuron_test module)
  cmake_parse_arguments(ARG "" "LABEL;TIMEOUT" "SOURCES;USES;LIBRARIES" ${ARGN})
  set(target ${module}_test)
  add_executable(${target} ${ARG_SOURCES})
  interneuron_link(${target} ${ARG_USES})
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES} GTest::gmock GTest::gtest GTest::gtest_main)
  target_compile_definitions(${target} PRIVATE INTERNEURON_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    INTERNEURON_BINARY_DIR="${PROJECT_BINARY_DIR}")
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  # Real time on real NICs: beside another test they would measure that one's load.
  set(serial FALSE)
  if(ARG_LABEL STREQUAL "netns")
    set(serial TRUE)
  endif()
  gtest_discover_tests(${target} TEST_PREFIX ${module}. DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    PROPERTIES TIMEOUT ${ARG_TIMEOUT} SKIP_RETURN_CODE 77 RUN_SERIAL ${serial} LABELS "${ARG_LABEL}")
endfunction()

function(interneuron_vm_test name)
  cmake_parse_arguments(ARG "FULL" "TIMEOUT" "COMMAND" ${ARGN})
  set(label vm)
  set(configurations)
  if(ARG_FULL)
    set(label vm full)
    set(configurations CONFIGURATIONS full)
  endif()
  add_test(NAME vm.${name} COMMAND ${ARG_COMMAND} ${configurations} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(vm.${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} SKIP_RETURN_CODE 77 RUN_SERIAL TRUE
    LABELS "${label}")
endfunction()

# The one library that users link: the union of the core's folders, without OpenCV.
function(interneuron_install_library)
  add_library(interneuron STATIC)
  add_library(interneuron::interneuron ALIAS interneuron)
  interneuron_closure(modules node policies)
  foreach(module IN LISTS modules)
    target_sources(interneuron PRIVATE $<TARGET_OBJECTS:interneuron_${module}>)
  endforeach()
  target_link_libraries(interneuron PUBLIC Threads::Threads PkgConfig::LIBNL PkgConfig::LIBPCAP)
  target_include_directories(interneuron PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(interneuron PUBLIC cxx_std_20)
  set_target_properties(interneuron PROPERTIES LINKER_LANGUAGE CXX)

  install(TARGETS interneuron EXPORT interneuronTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(DIRECTORY include/interneuron DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT interneuronTargets NAMESPACE interneuron::
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/interneuron)
  include(CMakePackageConfigHelpers)
  configure_package_config_file(cmake/interneuronConfig.cmake.in
    ${PROJECT_BINARY_DIR}/interneuronConfig.cmake
    INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/interneuron)
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/interneuronConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/interneuronConfig.cmake
                ${PROJECT_BINARY_DIR}/interneuronConfigVersion.cmake
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/interneuron)
endfunction()
