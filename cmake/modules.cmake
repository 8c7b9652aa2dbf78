# interneuron_headers(): the public headers, std only.
# interneuron_module(GROUP/NAME [SOURCES ...] [APART ...] [USES group/name ...] [LIBRARIES external ...]): one folder, one target
# interneuron_GROUP_NAME. Modules are object libraries, so that the installed library is their union; USES carries both
# include paths and objects. A folder of headers alone has no SOURCES; APART are sources that cannot be
# compiled together with others.
# interneuron_test_headers(): once, before the first interneuron_test().
# interneuron_test(GROUP/NAME [PROGRAM] [WAITS] [LABEL label] [TIMEOUT seconds] [COST seconds] [SHARDS n] [ALONE filter] [LONG case ...]
# SOURCES ... [USES ...]): the tests of one folder, one executable GROUP_NAME_test, which CTest runs as the one test NAME, or
# with SHARDS as NAME.1 to NAME.n with a share of the cases each; with LABEL netns as a test NAME.Suite.Case for each case.
# PROGRAM: they run the program `interneuron`. WAITS: they wait more than they compute. COST: about what one of its tests
# takes; the longest begin first. ALONE: a filter of GoogleTest for the cases of LABEL netns that are exact about time, so that
# no other test may run beside them. LONG: cases of LABEL netns that take many seconds, which begin before the others.
# interneuron_vm_test(NAME [FULL] TIMEOUT seconds COST seconds COMMAND ...): a test that boots a machine of scripts/vm.sh.
# FULL: takes minutes, so only `ctest -C full` runs it (scripts/test.sh --full).

set(INTERNEURON_WARNINGS -Wall -Wextra -Wconversion -Wshadow -Wpedantic -Werror)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # g++ 12 sees uninitialised members in moved std::variants (GCC bug 105562) and overlaps in string concatenations (GCC
  # bug 105651) that are not there; clang and the sanitizers look instead, in `scripts/check.sh asan` at the core, sockets and
  # app/perception, in `scripts/test.sh asan` at everything.
  list(APPEND INTERNEURON_WARNINGS -Wno-maybe-uninitialized -Wno-restrict)
  # In a jumbo unit g++ takes every type of a .cc file for one of a header, where unnamed namespaces are a mistake.
  if(INTERNEURON_JUMBO)
    list(APPEND INTERNEURON_WARNINGS -Wno-subobject-linkage)
  endif()
endif()

# Fuzz targets see which branches of a module were taken, in the same objects that the sanitized tests link. The tests, whose
# own branches interest nobody, are compiled without.
set(INTERNEURON_FUZZ_OPTIONS)
if(INTERNEURON_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "INTERNEURON_FUZZ needs clang: use the preset fuzz")
  endif()
  set(INTERNEURON_FUZZ_OPTIONS -fsanitize=fuzzer-no-link)
endif()

# The protocol and the sockets, whose costs are measured, are optimised as far as g++ goes; -O2 for the rest is a twentieth
# less to compile and costs nothing that anybody measures.
set(INTERNEURON_MEASURED_OPTIONS $<$<CONFIG:Release>:-O3>)

# What is tested is optimised as users run it; the tests themselves would take a third longer to compile with -O3. With the
# sanitizers they take less than half as long with -O0 as with -O1, which is more than they lose when they run.
set(INTERNEURON_TEST_OPTIONS $<$<CONFIG:Release>:-O1>)
if(CMAKE_CXX_FLAGS MATCHES "-fsanitize")
  set(INTERNEURON_TEST_OPTIONS -O0)
endif()

# Nine tenths of what the compiler reads is the standard library, so the files of a folder are compiled together, this many
# at a time: a folder of 16 files takes a third of the time that they take one by one. Sets `out` to what is to be compiled:
# units that include the files by their path in the tree, so that a compiler cache knows them in every clone. CMake's own
# (UNITY_BUILD) have absolute paths. Generated files stay by themselves.
set(INTERNEURON_JUMBO_FILES 16)
function(interneuron_jumbo out target)
  if(NOT INTERNEURON_JUMBO)
    set(${out} ${ARGN} PARENT_SCOPE)
    return()
  endif()
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  set(files)
  set(compiled)
  foreach(file IN LISTS ARGN)
    if(IS_ABSOLUTE ${file})
      list(APPEND compiled ${file})
    else()
      list(APPEND files ${file})
    endif()
  endforeach()
  set(number 0)
  while(files)
    set(content)
    foreach(_ RANGE 1 ${INTERNEURON_JUMBO_FILES})
      if(files)
        list(POP_FRONT files file)
        string(APPEND content "#include \"${folder}/${file}\"\n")
      endif()
    endforeach()
    set(unit ${CMAKE_CURRENT_BINARY_DIR}/${target}_${number}.cc)
    file(CONFIGURE OUTPUT ${unit} CONTENT "${content}" @ONLY)
    list(APPEND compiled ${unit})
    math(EXPR number "${number} + 1")
  endwhile()
  set(${out} ${compiled} PARENT_SCOPE)
endfunction()

# A folder by its name as a module: below src/ where it is there, else below the root.
function(interneuron_folder name)
  if(EXISTS ${PROJECT_SOURCE_DIR}/src/${name}/CMakeLists.txt)
    add_subdirectory(src/${name})
  else()
    add_subdirectory(${name})
  endif()
endfunction()

function(interneuron_headers)
  add_library(interneuron_include INTERFACE)
  target_include_directories(interneuron_include INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  add_custom_target(interneuron_layers ALL
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/scripts/check_layers.py
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} VERBATIM)
endfunction()

# The target of a module: core/wire is interneuron_core_wire.
function(interneuron_target out name)
  string(REPLACE "/" "_" flat ${name})
  set(${out} interneuron_${flat} PARENT_SCOPE)
endfunction()

function(interneuron_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;APART;USES;LIBRARIES" ${ARGN})
  interneuron_target(target ${name})
  if(NOT ARG_SOURCES)
    add_library(${target} INTERFACE)
    set_property(TARGET ${target} PROPERTY INTERNEURON_USES ${ARG_USES})
    set_property(TARGET ${target} PROPERTY INTERNEURON_LIBRARIES ${ARG_LIBRARIES})
    return()
  endif()
  interneuron_jumbo(compiled ${target} ${ARG_SOURCES})
  add_library(${target} OBJECT ${compiled} ${ARG_APART})
  target_compile_options(${target} PRIVATE ${INTERNEURON_WARNINGS} ${INTERNEURON_FUZZ_OPTIONS})
  if(name MATCHES "^(core|policies|node)")
    target_compile_options(${target} PRIVATE ${INTERNEURON_MEASURED_OPTIONS})
  endif()
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR})
  # Headers of a module may include those of the libraries that it uses.
  interneuron_closure(used ${ARG_USES})
  set(libraries ${ARG_LIBRARIES})
  foreach(module IN LISTS used)
    interneuron_target(module_target ${module})
    get_property(more TARGET ${module_target} PROPERTY INTERNEURON_LIBRARIES)
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
    interneuron_target(module_target ${module})
    get_property(uses TARGET ${module_target} PROPERTY INTERNEURON_USES)
    list(APPEND todo ${uses})
  endwhile()
  set(${out} ${done} PARENT_SCOPE)
endfunction()

# Links modules, with all that they use, into an executable or library. What has sockets has every part of the library.
function(interneuron_link target)
  interneuron_closure(modules ${ARGN})
  if(node/io IN_LIST modules)
    interneuron_closure(modules ${ARGN} ${INTERNEURON_PART_MODULES})
  endif()
  foreach(module IN LISTS modules)
    interneuron_target(module_target ${module})
    get_target_property(type ${module_target} TYPE)
    if(type STREQUAL "OBJECT_LIBRARY")
      target_sources(${target} PRIVATE $<TARGET_OBJECTS:${module_target}>)
    endif()
    get_property(libraries TARGET ${module_target} PROPERTY INTERNEURON_LIBRARIES)
    target_link_libraries(${target} PRIVATE ${libraries})
  endforeach()
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR})
  target_link_libraries(${target} PRIVATE interneuron_include)
  target_compile_options(${target} PRIVATE ${INTERNEURON_WARNINGS})
endfunction()

# What nearly every test includes, compiled once for all of them: a third to a half of what they take otherwise.
# Built with -fPIE as executables are, or GCC would not accept it there.
function(interneuron_test_headers)
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/test_headers.cc CONTENT "")
  add_library(interneuron_test_headers OBJECT ${CMAKE_CURRENT_BINARY_DIR}/test_headers.cc)
  set_target_properties(interneuron_test_headers PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(interneuron_test_headers PRIVATE ${INTERNEURON_WARNINGS} ${INTERNEURON_TEST_OPTIONS} -fPIE)
  target_link_libraries(interneuron_test_headers PRIVATE GTest::gmock GTest::gtest)
  target_precompile_headers(interneuron_test_headers PRIVATE <gmock/gmock.h> <gtest/gtest.h> <algorithm> <array> <chrono>
    <cstdio> <fstream> <functional> <map> <memory> <optional> <random> <set> <span> <sstream> <string> <thread> <variant>
    <vector>)
endfunction()

# interneuron_program(NAME SOURCES ... USES ... DESTINATION folder): a program, as interneuron in build/PRESET; its target is
# NAME with underscores and _program, and `ninja NAME` builds it as well.
function(interneuron_program name)
  cmake_parse_arguments(ARG "" "DESTINATION" "SOURCES;USES" ${ARGN})
  string(REPLACE "-" "_" target ${name}_program)
  add_executable(${target} ${ARG_SOURCES})
  interneuron_link(${target} ${ARG_USES})
  target_compile_definitions(${target} PRIVATE INTERNEURON_VERSION="${PROJECT_VERSION}")
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
  # Whoever builds the programs alone, as scripts/demo.sh does, can install all the same.
  get_property(archives GLOBAL PROPERTY INTERNEURON_ARCHIVES)
  add_dependencies(${target} ${archives})
  install(TARGETS ${target} RUNTIME DESTINATION ${ARG_DESTINATION})
endfunction()

# Absolute paths, in one object for all tests, so that the others are the same in every clone.
function(interneuron_test_places)
  add_library(interneuron_places OBJECT ${PROJECT_SOURCE_DIR}/tests/places.cc)
  target_include_directories(interneuron_places PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(interneuron_places PRIVATE ${INTERNEURON_WARNINGS})
  if(INTERNEURON_PROGRAM)
    set(program $<TARGET_FILE:interneuron_program>)
    set(nature $<TARGET_FILE:nature>)
  endif()
  target_compile_definitions(interneuron_places PRIVATE INTERNEURON_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    INTERNEURON_BINARY_DIR="${PROJECT_BINARY_DIR}" INTERNEURON_PROGRAM_FILE="${program}" INTERNEURON_NATURE_FILE="${nature}")
endfunction()

function(interneuron_test module)
  cmake_parse_arguments(ARG "PROGRAM;WAITS" "LABEL;TIMEOUT;COST;SHARDS;ALONE" "SOURCES;APART;USES;LIBRARIES;LONG" ${ARGN})
  string(REPLACE "/" "_" target ${module}_test)
  get_filename_component(name ${module} NAME)
  interneuron_jumbo(compiled ${target} ${ARG_SOURCES})
  add_executable(${target} ${compiled} ${ARG_APART})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name}_test)
  interneuron_link(${target} ${ARG_USES})
  target_compile_options(${target} PRIVATE ${INTERNEURON_TEST_OPTIONS})
  target_precompile_headers(${target} REUSE_FROM interneuron_test_headers)
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES} rapidcheck rapidcheck_gtest GTest::gmock GTest::gtest GTest::gtest_main)
  target_sources(${target} PRIVATE $<TARGET_OBJECTS:interneuron_places>)
  if(ARG_PROGRAM)
    # The door and the siblings that it starts.
    add_dependencies(${target} interneuron_program interneuron_offload_program interneuron_lab_program)
  endif()
  if(NOT ARG_COST)
    set(ARG_COST 1)
  endif()
  if(ARG_LABEL STREQUAL "netns")
    # A process for each case, because a case that is killed in the middle leaves namespaces and NICs to the next. They wait
    # more than they compute, and each has namespaces of its own, so that several run at once.
    if(NOT ARG_TIMEOUT)
      set(ARG_TIMEOUT 120)
    endif()
    set(discovery TEST_PREFIX ${name}. DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60)
    set(properties TIMEOUT ${ARG_TIMEOUT} SKIP_RETURN_CODE 77 LABELS "${ARG_LABEL}")
    if(ARG_ALONE)
      gtest_discover_tests(${target} ${discovery} TEST_FILTER "${ARG_ALONE}" PROPERTIES ${properties} COST ${ARG_COST} RUN_SERIAL TRUE)
    endif()
    if(ARG_LONG)
      list(JOIN ARG_LONG ":" ARG_LONG)
      gtest_discover_tests(${target} ${discovery} TEST_FILTER "${ARG_LONG}" PROPERTIES ${properties} COST 15)
    endif()
    # These are the cases that neither filter names.
    set(rest ${ARG_ALONE} ${ARG_LONG})
    if(rest)
      list(JOIN rest ":" rest)
      set(discovery ${discovery} TEST_FILTER "-${rest}")
    endif()
    gtest_discover_tests(${target} ${discovery} PROPERTIES ${properties} COST ${ARG_COST})
    return()
  endif()
  # All cases in one process, or a few: a thousand starts of sanitized programs with OpenCV would take minutes. One that
  # computes takes two of the places of scripts/test.sh, which has two for each processor.
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 900)
  endif()
  set(places 2)
  if(ARG_WAITS)
    set(places 1)
  endif()
  set(tests)
  if(NOT ARG_SHARDS)
    set(tests ${name})
    add_test(NAME ${name} COMMAND ${target})
  else()
    foreach(shard RANGE 1 ${ARG_SHARDS})
      list(APPEND tests ${name}.${shard})
      math(EXPR index "${shard} - 1")
      add_test(NAME ${name}.${shard} COMMAND ${target})
      set_tests_properties(${name}.${shard} PROPERTIES ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_SHARDS};GTEST_SHARD_INDEX=${index}")
    endforeach()
  endif()
  set_tests_properties(${tests} PROPERTIES TIMEOUT ${ARG_TIMEOUT} PROCESSORS ${places} COST ${ARG_COST} LABELS "${ARG_LABEL}")
endfunction()

function(interneuron_vm_test name)
  cmake_parse_arguments(ARG "FULL" "TIMEOUT;COST" "COMMAND" ${ARGN})
  set(label vm)
  set(configurations)
  if(ARG_FULL)
    set(label vm full)
    set(configurations CONFIGURATIONS full)
  endif()
  add_test(NAME vm.${name} COMMAND ${ARG_COMMAND} ${configurations} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(vm.${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} SKIP_RETURN_CODE 77 PROCESSORS 2 COST ${ARG_COST}
    LABELS "${label}")
endfunction()

# The parts that this build has, in INTERNEURON_PARTS: those of cmake/parts.cmake that nobody has switched off and whose
# libraries are here.
function(interneuron_find_parts)
  set(parts)
  foreach(part IN LISTS INTERNEURON_ALL_PARTS)
    string(TOUPPER INTERNEURON_${part} option)
    set(${option} AUTO CACHE STRING "Build the part ${part} of the library: ON, OFF, or AUTO (where what it needs is found)")
    set(lacks "${option} to be ON")
    if(${option})
      interneuron_part_lacks(lacks ${part} ${parts})
    endif()
    if(NOT lacks)
      list(APPEND parts ${part})
    elseif(INTERNEURON_PROGRAM OR INTERNEURON_TESTS OR (${option} AND NOT ${option} STREQUAL "AUTO"))
      message(FATAL_ERROR "The part ${part} needs ${lacks} (scripts/setup.sh installs what is missing). A build without it is one of "
        "the library alone: -DINTERNEURON_PROGRAM=OFF -DINTERNEURON_TESTS=OFF -D${option}=OFF")
    else()
      message(STATUS "Without the part ${part}: it needs ${lacks}")
    endif()
  endforeach()
  set(INTERNEURON_PARTS ${parts} PARENT_SCOPE)
  list(TRANSFORM parts PREPEND node/)
  set(INTERNEURON_PART_MODULES ${parts} PARENT_SCOPE)
endfunction()

# The library that a part needs beside the others, as a target; empty: none.
function(interneuron_part_library out part)
  set(library)
  if(INTERNEURON_${part}_PACKAGES)
    list(GET INTERNEURON_${part}_PACKAGES 0 prefix)
    set(library PkgConfig::${prefix})
  endif()
  set(${out} ${library} PARENT_SCOPE)
endfunction()

# A static library that is the union of modules, without those that another one has: interneuron::ALIAS after installing.
# EXPORT: the set of targets that it is exported with; EXCEPT: without the objects of these sources.
function(interneuron_archive target alias)
  cmake_parse_arguments(ARG "" "EXPORT;EXCEPT" "USES;WITHOUT;LIBRARIES" ${ARGN})
  add_library(${target} STATIC)
  add_library(interneuron::${alias} ALIAS ${target})
  interneuron_closure(modules ${ARG_USES})
  interneuron_closure(others ${ARG_WITHOUT})
  foreach(module IN LISTS modules)
    interneuron_target(module_target ${module})
    get_property(type TARGET ${module_target} PROPERTY TYPE)
    if(type STREQUAL "OBJECT_LIBRARY" AND NOT module IN_LIST others)
      set(objects $<TARGET_OBJECTS:${module_target}>)
      if(ARG_EXCEPT)
        set(objects $<FILTER:${objects},EXCLUDE,/${ARG_EXCEPT}[.]cc>)
      endif()
      target_sources(${target} PRIVATE ${objects})
    endif()
  endforeach()
  target_link_libraries(${target} PUBLIC ${ARG_LIBRARIES})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES LINKER_LANGUAGE CXX EXPORT_NAME ${alias})
  if(ARG_EXPORT)
    set(export EXPORT ${ARG_EXPORT})
  endif()
  install(TARGETS ${target} ${export} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  set_property(GLOBAL APPEND PROPERTY INTERNEURON_ARCHIVES ${target})
endfunction()

# interneuron::PART, which the linker takes into a program although only a weak reference asks for it (src/node/io/parts.h).
function(interneuron_part_archive part)
  interneuron_part_library(library ${part})
  set(libraries interneuron ${library})
  set(others node/loop)
  if(INTERNEURON_${part}_NEEDS)
    list(PREPEND libraries interneuron-${INTERNEURON_${part}_NEEDS})
    list(APPEND others node/${INTERNEURON_${part}_NEEDS})
  endif()
  interneuron_archive(interneuron-${part} ${part} EXPORT interneuron-${part} USES node/${part} WITHOUT ${others}
    LIBRARIES ${libraries})
  target_link_options(interneuron-${part} INTERFACE LINKER:--undefined=interneuron_${part}_part)
endfunction()

# What users link: interneuron::core, the protocol alone; interneuron::node, with sockets and the loop; the parts of
# cmake/parts.cmake; interneuron::interneuron, which is node with parts; and libinterneuron-all.a, all of it in one archive for
# programs that are built without CMake.
function(interneuron_install_library)
  set(core core/endpoint policies)
  interneuron_archive(interneuron-core core EXPORT interneuronTargets USES ${core}
    LIBRARIES PkgConfig::LIBISAL PkgConfig::LIBSODIUM)
  interneuron_archive(interneuron node EXPORT interneuronTargets USES node/loop policies WITHOUT ${core}
    LIBRARIES interneuron-core Threads::Threads)
  set(config ${CMAKE_INSTALL_LIBDIR}/cmake/interneuron)
  add_library(interneuron_with_parts INTERFACE)
  add_library(interneuron::interneuron ALIAS interneuron_with_parts)
  target_link_libraries(interneuron_with_parts INTERFACE interneuron)
  set(libraries)
  foreach(part IN LISTS INTERNEURON_PARTS)
    interneuron_part_archive(${part})
    interneuron_part_library(library ${part})
    list(APPEND libraries ${library})
    target_link_libraries(interneuron_with_parts INTERFACE interneuron-${part})
    install(EXPORT interneuron-${part} NAMESPACE interneuron:: DESTINATION ${config})
  endforeach()

  # Its references to parts are strong: parts.cc is compiled anew for it.
  interneuron_archive(interneuron-all all USES node/loop policies ${INTERNEURON_PART_MODULES} EXCEPT parts
    LIBRARIES Threads::Threads ${libraries} PkgConfig::LIBISAL PkgConfig::LIBSODIUM)
  target_sources(interneuron-all PRIVATE ${PROJECT_SOURCE_DIR}/src/node/io/parts.cc)
  target_include_directories(interneuron-all PRIVATE ${PROJECT_SOURCE_DIR}/src)
  list(TRANSFORM INTERNEURON_PARTS PREPEND INTERNEURON_HOLDS_ OUTPUT_VARIABLE holds)
  target_compile_definitions(interneuron-all PRIVATE ${holds})

  install(DIRECTORY include/interneuron DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT interneuronTargets NAMESPACE interneuron:: DESTINATION ${config})
  include(CMakePackageConfigHelpers)
  configure_package_config_file(cmake/interneuronConfig.cmake.in
    ${PROJECT_BINARY_DIR}/interneuronConfig.cmake INSTALL_DESTINATION ${config})
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/interneuronConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/interneuronConfig.cmake ${PROJECT_BINARY_DIR}/interneuronConfigVersion.cmake
    DESTINATION ${config})
  install(FILES ${PROJECT_SOURCE_DIR}/cmake/parts.cmake DESTINATION ${config} RENAME interneuronParts.cmake)
endfunction()
