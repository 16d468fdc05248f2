"""`twillight view`: a fabric in a page of one file, drawn by the shader of `soft_nodes` while light and viewer turn.

view (the verb), content (what the page has of the fabric: tables, tiles), shapes (plane, sphere and drape in NumPy).
`cloth.slang` draws; generate makes `cloth.frag` and `selvage.frag` of it, which the package has. The page is
`page.html` with `page.css` and the scripts `tables.js` (buffers of a cloth, edited), `picture.js` (WebGL 2) and
`controls.js`.
"""
