# Installs the library of build tree ${library} under ${build}, then configures, builds and runs the consumer there.
file(REMOVE_RECURSE ${build})

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

run(${CMAKE_COMMAND} --install ${library} --prefix ${build}/installed)
run(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR} -B ${build}/build -G ${generator}
    -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_PREFIX_PATH=${build}/installed)
run(${CMAKE_COMMAND} --build ${build}/build)
run(${build}/build/consumer)
