"""A fabric in a page of one file, drawn by the shader of `soft_nodes` while light and viewer turn.

view writes the page and its content (tables, tiles); shapes has plane, sphere and drape in NumPy. `cloth.slang` draws;
generate makes of it the `.frag.gz` that the package has. The page is `page.html` with
`page.css` and the scripts `tables.js` (buffers of a cloth, edited), `picture.js` (WebGL 2) and `controls.js`.
"""
