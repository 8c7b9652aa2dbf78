# cmake -DBINARY_DIR= -DSOURCE_DIR= -DGENERATOR= -DCXX_COMPILER= -DCXX_FLAGS= -DBUILD_TYPE= -P install_test.cmake
# Everything happens below BINARY_DIR/install_test, which is made anew.
cmake_minimum_required(VERSION 3.25)
set(work ${BINARY_DIR}/install_test)
set(prefix ${work}/prefix)

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    string(JOIN " " command ${ARGN})
    message(FATAL_ERROR "${command}\nfailed (${code}):\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${work})
run(${CMAKE_COMMAND} --install ${BINARY_DIR} --prefix ${prefix})
# The examples are copied, so that no header of the source tree can be found by accident.
file(COPY ${SOURCE_DIR}/examples DESTINATION ${work})
run(${CMAKE_COMMAND} -S ${work}/examples -B ${work}/build -G ${GENERATOR}
  -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${CXX_COMPILER}
  "-DCMAKE_CXX_FLAGS=${CXX_FLAGS} -Wall -Wextra -Wpedantic -Werror" -DCMAKE_BUILD_TYPE=${BUILD_TYPE})
run(${CMAKE_COMMAND} --build ${work}/build)
run(${work}/build/hello)
message(STATUS "${output}")
if(NOT output MATCHES "^[0-9.]+ ms: hello, vehicle\n")
  message(FATAL_ERROR "hello said: ${output}")
endif()
